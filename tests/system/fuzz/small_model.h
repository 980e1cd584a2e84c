#pragma once

#include <memory>

#include "core/query/scene_model.h"
#include "kernels/backend.h"
#include "server/api/segment_request.h"
#include "server/store/store.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::fuzz {

// A model of two blobs in three small views, one of them held out, with what a request needs to ask
// about it: "scenes/shelf/models/1" with a label "red" of view "front".
class SmallModel {
 public:
  SmallModel();

  const SceneModel& model() const { return *model_; }
  SegmentRequestReader reader() const { return {model_->model(), {scene_, 1}, *store_}; }

 private:
  testing::TempFolder folder_;
  std::unique_ptr<Backend> backend_;
  std::unique_ptr<Store> store_;
  SceneRef scene_;
  std::unique_ptr<SceneModel> model_;
};

}  // namespace pepeseg::fuzz
