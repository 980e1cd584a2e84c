#pragma once

#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "pepeseg/v1/find.pb.h"
#include "server/rpc/call_runner.h"
#include "server/services/seen_models.h"
#include "server/services/view_images.h"
#include "server/services/word_source.h"

namespace pepeseg {

// Answers FindSegments calls. Thread safe. All that it refers to must outlive it.
class FindAnswers {
 public:
  // words: asked in this order.
  FindAnswers(ModelLoader& models, ViewImages& images, SeenModels& seen,
              std::vector<WordSource*> words)
      : models_(models), images_(images), seen_(seen), words_(std::move(words)) {}

  // Blocks for as long as the model takes to load, to be decomposed and to be looked at.
  absl::Status Find(const UnaryCall& call, const v1::FindSegmentsRequest& request,
                    v1::FindSegmentsResponse* response);

 private:
  absl::Status FindText(const UnaryCall& call, const ResidentModel& model,
                        const v1::FindSegmentsRequest& request, v1::FindSegmentsResponse* response);
  absl::Status FindLike(const UnaryCall& call, const ResidentModel& model,
                        const v1::FindSegmentsRequest& request, v1::FindSegmentsResponse* response);
  absl::StatusOr<LookedFor> ReadLike(const UnaryCall& call, const ResidentModel& model,
                                     const SceneSegments& all, ImageEncoder& encoder,
                                     const v1::FindSegmentsRequest& request) const;

  ModelLoader& models_;
  ViewImages& images_;
  SeenModels& seen_;
  const std::vector<WordSource*> words_;
};

}  // namespace pepeseg
