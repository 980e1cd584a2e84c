#pragma once

#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/query/scene_model.h"
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

// Returns the views that a request means, in the order of the request; none without targets.
absl::StatusOr<std::vector<ModelView>> FindTargets(const v1::SegmentViewsRequest::Targets& targets,
                                                   const Model& model);

// Returns a label as a prompt in its view, whose mask has the view's size. FAILED_PRECONDITION: the
// model, which `number` names, does not have the view.
absl::StatusOr<Prompt> PromptOfLabel(const LabelRecord& label, const Model& model,
                                     const SceneChild& number);

// Returns the images of a prompt, which are masks of its view.
std::vector<const v1::MaskImage*> ImagesOf(const v1::Prompt& prompt);
// Reads a camera that is not one of the model's, see CheckView for its limits.
absl::StatusOr<ModelView> FreeViewFromProto(const v1::Viewpoint::FreeCamera& proto,
                                            const std::string& field);
// Takes a prompt, which is in pixels of the frame, to its view: Frame::ToView.
absl::StatusOr<Prompt> ToViewAt(const Frame& frame, Prompt prompt, const std::string& field);

// Returns the proposals with their masks.
absl::Status FillProposals(const Proposals& proposals, v1::MaskEncoding encoding,
                           v1::ProposeScalesResponse* response);

// Reads the parts of requests about one model. The model and the store, which has the scene's
// labels, must outlive it.
class SegmentRequestReader {
 public:
  // `number`: scene and number of the model.
  SegmentRequestReader(const Model& model, const SceneChild& number, Store& store)
      : model_(model), number_(number), store_(store) {}

  absl::StatusOr<SegmentRequest> Read(const v1::SegmentViewsRequest& request) const;
  absl::StatusOr<ProposeRequest> Read(const v1::ProposeScalesRequest& request) const;

  // Reads a prompt in the pixels of the image of its view as one in the pixels of the view, see
  // Frame::ToView. A label is read as its mask. NOT_FOUND: no such label. FAILED_PRECONDITION: the
  // model does not have the view of the label. Blocks on the store.
  using ImageOfView = absl::FunctionRef<Frame(const ModelView&)>;
  absl::StatusOr<Prompt> ReadPrompt(const v1::Prompt& prompt, ImageOfView image_of,
                                    const std::string& field) const;
  // Reads the field `prompt` of a request, in pixels of `frame`.
  absl::StatusOr<Prompt> ReadPrompt(const v1::Prompt& prompt, v1::PixelFrame frame) const;
  absl::StatusOr<Granularity> ReadGranularity(const v1::Granularity& granularity,
                                              const std::string& field) const;
  const Model& model() const { return model_; }

 private:
  // Reads a label, which is given by id or name, as its mask.
  absl::StatusOr<Prompt> ReadLabel(const std::string& label, const std::string& field) const;

  const Model& model_;
  const SceneChild number_;
  Store& store_;
};

}  // namespace pepeseg
