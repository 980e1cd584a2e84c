#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/decomposition.h"
#include "core/query/frame.h"
#include "core/query/image_segmenter.h"
#include "core/query/mask_geometry.h"
#include "core/query/prompt.h"
#include "core/query/prompted_thing.h"
#include "core/query/propose.h"
#include "core/query/render_view.h"
#include "core/query/segmenter.h"
#include "core/query/select_gaussians.h"
#include "core/scene/gaussians.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

// The door of this folder: what a model in memory answers. The protocols of core/evaluate, which
// ask for features, use Segmenter.

namespace pepeseg {

// Bytes of the host's memory and of the device's memory.
struct MemoryBytes {
  int64_t host = 0, device = 0;

  MemoryBytes& operator+=(const MemoryBytes& other) {
    host += other.host;
    device += other.device;
    return *this;
  }
  MemoryBytes& operator-=(const MemoryBytes& other) {
    host -= other.host;
    device -= other.device;
    return *this;
  }
};

// Returns an upper bound of what a Segmenter of such a model takes on the host and on the backend:
// Gaussians and features, the decompositions and feature maps that it may keep, and the scratch of
// a render of MostPixels pixels (Backend::ScratchBytes). What a single query takes in addition,
// such as blend rows or a larger view, is not counted: it is freed with the query.
MemoryBytes BytesOfModel(const Backend& backend, const ModelShape& shape);

struct SegmentRequest {
  Prompt prompt;
  Granularity granularity;
  std::vector<ModelView> targets;            // views to segment, at least one
  FrameKind frame = FrameKind::kPhotograph;  // of the masks
  SegmentOptions options;
  // Segments the images of the views; must outlive the answer. Null: only the model answers.
  ImageSegmenter* images = nullptr;
  // Of `images`: places the borders of the masks, or answers with the model (PromptedThing), for a
  // prompt of points or a box without scale and threshold.
  bool image_borders = false, image_clicks = false;
  // With image_clicks: `images` does not place the mask in other views than the prompt's.
  bool images_of_prompted_view_only = false;
};

// The masks of a prompt in its target views, computed one by one, so that a thread can turn to
// other work in between. The model must outlive it. For one thread at a time.
class SegmentedViews {
 public:
  // thing: of the prompt.
  SegmentedViews(SegmentRequest request, PromptedThing thing, WantedCheck check)
      : request_(std::move(request)), thing_(std::move(thing)), check_(std::move(check)) {}

  // Returns whether all targets are segmented.
  bool done() const { return next_ == request_.targets.size(); }
  // From now on the model alone answers: the image segmenter has failed.
  void LeaveImages();
  // Returns the mask of the next target, in pixels of the frame. After an error, that of the same
  // target. In the view of a box prompt it is
  // cut to the box, see CutToBox. Errors are those of `check`, of the image segmenter and of
  // Segmenter::Segment. Must not be done.
  absl::StatusOr<SegmentResult> Next();

 private:
  SegmentRequest request_;
  PromptedThing thing_;
  WantedCheck check_;
  size_t next_ = 0;
  std::optional<Frame> frame_;  // of the last target: views of one camera mostly follow each other
};

// A model in memory. Thread safe. Any call may return the errors of the device, see Segmenter.
class SceneModel {
 public:
  // Loads a model onto the device, see Segmenter::Create. The backend must outlive the model.
  static absl::StatusOr<std::unique_ptr<SceneModel>> Create(Backend& backend, Model model,
                                                            MapCounts* counts = nullptr);

  const Model& model() const { return segmenter_->model(); }
  const Segmenter& segmenter() const { return *segmenter_; }
  // Returns whether the model has a trained feature field; without one, nothing is found in it.
  bool has_features() const { return segmenter_->has_features(); }

  // Chooses the granularity where the request has none, see PromptedThing::Find for the
  // errors, and returns the masks to come.
  absl::StatusOr<SegmentedViews> Segment(SegmentRequest request, WantedCheck check) const;
  absl::StatusOr<Proposals> Propose(const ProposeRequest& request) const;
  // See SelectGaussians. Errors are also those of PromptedThing::Find.
  absl::StatusOr<GaussianSet> Select(const SelectRequest& request, const WantedCheck& check) const;
  // See Segmenter::WithDecomposition.
  absl::Status Decompose(std::span<const double> scales,
                         absl::FunctionRef<absl::Status(const Decomposition&)> use) const;
  absl::StatusOr<RenderedView> Render(const RenderRequest& request) const;

 private:
  explicit SceneModel(std::unique_ptr<Segmenter> segmenter) : segmenter_(std::move(segmenter)) {}
  const std::unique_ptr<Segmenter> segmenter_;
};

}  // namespace pepeseg
