#pragma once

#include <cstdint>
#include <optional>

#include "absl/status/status.h"
#include "core/reconstruct/densifier.h"
#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/reconstruct.h"
#include "core/reconstruct/schedule.h"
#include "core/reconstruct/view_masks.h"

namespace pepeseg {

// Gaussian refinement (METHOD.md section 1): in a short window of steps, Gaussians on a surface
// that cross the border of a mask are shortened to one side of it. Only those that existed when
// the window opened, each refined once; one that was looked at and crossed nothing in that view may
// be refined by a later one.
class Refiner {
 public:
  // The window begins at the first step of its share of the run that trains at full size. Its
  // masks are kept in backend memory until it ends.
  Refiner(Backend& backend, const Capture& capture, const ReconstructOptions& options,
          const Schedule& schedule);

  bool allocated() const { return !masks_ || masks_->allocated(); }
  // Steps count from 0 and are told after their update. On a step of density control nothing is
  // due.
  bool Due(int step) const;

  struct Target {
    int view = 0;  // among the training views
    PinholeView pinhole;
    float near_plane = 0;
  };
  // Renders the state in this view once more and refines it. RESOURCE_EXHAUSTED when the backend
  // is out of memory. Waits for the backend.
  absl::Status Apply(const Target& target, GaussianState& state);
  // After each step: gives the memory back when the window is over.
  void EndStep(int step, GaussianState& state);

  struct Counts {
    int64_t num_refined = 0;  // Gaussians that were shortened, since the start of the stage
    int64_t num_split = 0;    // Gaussians that were added
  };
  const Counts& counts() const { return counts_; }
  void Restore(const Counts& counts) { counts_ = counts; }

 private:
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
  std::optional<ViewMasks> masks_;  // none: nothing is ever due
  std::optional<Working> working_;
  int first_ = 0, end_ = 0;  // steps of the window
  Counts counts_;
};

}  // namespace pepeseg
