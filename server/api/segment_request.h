#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/query/propose_scales.h"
#include "core/scene/model.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/api/resource_name.h"
#include "server/store/store.h"

// Reads what a request asks a model, in the model's terms. Everything returns INVALID_ARGUMENT that
// names the field, at or below `field` where that is given.
namespace pepeseg {

// Returns the model's view of this name.
absl::StatusOr<ModelView> FindView(const std::string& name, const Model& model,
                                   const std::string& field);
// Returns the model's view that a viewpoint names, or its free camera.
absl::StatusOr<ModelView> FindViewpoint(const v1::Viewpoint& viewpoint, const Model& model,
                                        const std::string& field);

// Returns a label as a prompt in its view, whose mask has the view's size. FAILED_PRECONDITION: the
// model, which `number` names, does not have the view.
absl::StatusOr<Prompt> PromptOfLabel(const LabelRow& label, const Model& model,
                                     const SceneChild& number);

// A SegmentViewsRequest.
struct SegmentQuery {
  Prompt prompt;
  Granularity granularity;
  std::vector<ModelView> targets;  // the views to segment, at least one
  SegmentOptions options;
};

// A ProposeScalesRequest.
struct ProposalQuery {
  ModelView view;
  std::vector<PointPrompt> points;
  int max_proposals;
  SegmentOptions options;
};

// Returns everything but the mask.
v1::ProposeScalesResponse::Proposal ProposalToProto(const ScaleProposal& proposal);

// Reads the parts of requests about one model. The model and the store, which has the scene's
// labels, must outlive it.
class SegmentRequestReader {
 public:
  // `number`: scene and number of the model.
  SegmentRequestReader(const Model& model, const SceneChild& number, Store& store)
      : model_(model), number_(number), store_(store) {}

  absl::StatusOr<SegmentQuery> Read(const v1::SegmentViewsRequest& request) const;
  absl::StatusOr<ProposalQuery> Read(const v1::ProposeScalesRequest& request) const;

  // Reads a prompt in the pixels of `frame` as one in the pixels of its view. A label is read as
  // its mask. Refuses points and boxes outside the image, or outside the part of it that the view
  // shows. NOT_FOUND: no such label. FAILED_PRECONDITION: the model does not have the view of the
  // label. Blocks on the store.
  absl::StatusOr<Prompt> ReadPrompt(const v1::Prompt& prompt, v1::PixelFrame frame) const;
  absl::StatusOr<Granularity> ReadGranularity(const v1::Granularity& granularity,
                                              const std::string& field) const;
  // Reads a label, which is given by id or name, as its mask. For errors see ReadPrompt. Blocks on
  // the store.
  absl::StatusOr<Prompt> ReadLabel(const std::string& label, const std::string& field) const;
  const Model& model() const { return model_; }

 private:
  absl::StatusOr<std::vector<ModelView>> FindTargets(const v1::SegmentViewsRequest& request,
                                                     const ModelView& prompt_view) const;

  const Model& model_;
  const SceneChild number_;
  Store& store_;
};

}  // namespace pepeseg
