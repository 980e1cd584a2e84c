#pragma once

#include <memory>

#include "kernels/backend.h"
#include "server/services/model_lookup.h"
#include "server/store/store.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::fuzz {

// A model of two blobs in three small views, one of them held out, and what a request about it
// needs: the name "scenes/shelf/models/1", and a label "red" of view "front".
class SmallModel {
 public:
  SmallModel();

  const ServiceContext& context() const { return context_; }
  const ResidentModel& resident() const { return resident_; }

 private:
  testing::TempFolder folder_;
  std::unique_ptr<Backend> backend_;
  std::unique_ptr<Store> store_;
  ServiceContext context_{};
  ResidentModel resident_;
};

}  // namespace pepeseg::fuzz
