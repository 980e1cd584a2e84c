#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "core/reconstruct/densifier.h"
#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/options.h"
#include "core/reconstruct/schedule.h"
#include "core/scene/capture.h"
#include "kernels/backend.h"

namespace pepeseg {

// The masks of a capture's training views in memory that ops can read, for refinement (METHOD.md
// section 1, "Refinement"): as mask cells at full size (see MaskSet). Views are numbered as in
// TrainingViews.
class ViewMasks {
 public:
  ViewMasks(Backend& backend, const Capture& capture, MemoryPlace place = MemoryPlace::kDevice);

  bool any() const { return any_; }              // true: at least one view has masks
  bool allocated() const { return allocated_; }  // false: the backend is out of memory
  bool HasMasks(int view) const { return !views_[view].mask_area.empty(); }
  PatchMap At(int view) const;

 private:
  struct Masks {
    int words = 0;
    Buffer<uint32_t> pixel_cell;
    Buffer<uint64_t> cell_bits;
    Buffer<int64_t> mask_area;
  };

  Masks Upload(Backend& backend, const MaskSet& masks, MemoryPlace place);

  bool any_ = false;
  bool allocated_ = true;
  std::vector<Masks> views_;
};

// Gaussian refinement (METHOD.md section 1, "Refinement"): in a short window of steps, Gaussians on
// a surface that cross the border of a mask are shortened to one side of it. Each Gaussian that
// existed when the window opened is refined at most once. A Gaussian that crosses nothing in one
// view may still be refined in a later one. `step` is the schedule position, from 0, of a step
// whose update is done.
class Refiner {
 public:
  // The window begins at the first step from refine_from on that trains at full size. The masks
  // stay in memory, at `place`, until it ends.
  Refiner(Backend& backend, const Capture& capture, const ReconstructOptions& options,
          const Schedule& schedule, MemoryPlace place = MemoryPlace::kDevice);

  // False: the backend is out of memory.
  bool allocated() const { return !masks_ || masks_->allocated(); }
  // True in the window. The caller skips refinement in a step of density control.
  bool Due(int step) const;

  struct Target {
    int view = 0;  // index among the training views
    PinholeView pinhole;
    float near_plane = 0;
  };
  // Renders the updated state from the target's view and refines it; does nothing in a view without
  // masks. Waits for the backend. Returns RESOURCE_EXHAUSTED when it is out of memory.
  absl::Status Apply(const Target& target, GaussianState& state);
  // To be called after each step: frees the memory when the window is over.
  void EndStep(int step, GaussianState& state);

  // Totals since the start of the stage.
  struct Counts {
    int64_t num_refined = 0;  // Gaussians that were shortened
    int64_t num_split = 0;    // Gaussians that were added
  };
  const Counts& counts() const { return counts_; }
  void Restore(const Counts& counts) { counts_ = counts; }

 private:
  // Memory of Apply, kept between the steps of the window.
  struct Working {
    RenderScratch render;
    RefineScratch refine;
    Buffer<float> color, alpha, depth;  // of the largest view so far
    Buffer<int32_t> outside_source;
    Buffer<float> outside_shape;
    Buffer<int64_t> counts;
  };

  void Render(const Target& target, GaussianState& state);
  RefineGaussiansArgs MakeArgs(const Target& target, GaussianState& state);

  Backend& backend_;
  const ReconstructOptions options_;
  std::optional<ViewMasks> masks_;  // empty: no refinement, or its window is over
  std::optional<Working> working_;  // empty before the first step of the window
  int first_ = 0, end_ = 0;         // the window: steps in [first_, end_)
  Counts counts_;
};

}  // namespace pepeseg
