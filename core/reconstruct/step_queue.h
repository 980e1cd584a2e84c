#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "core/reconstruct/depth_term.h"
#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/options.h"
#include "core/reconstruct/preparation.h"
#include "core/reconstruct/step_results.h"
#include "kernels/backend.h"

namespace pepeseg {

// Returns the number of steps that stage one does at once, 1 to kMaxUpdateSteps: views_at_once of
// the options or, where that is 0, as many as the backend has branches for (Backend::num_branches)
// and photographs of `max_pixels` need to fill a device. 1 with a depth loss, whose images all
// steps share.
int StepsAtOnce(int num_branches, const ReconstructOptions& options, int64_t max_pixels);

// Returns the pixels that each slot of a StepQueue has room for, largest first: smaller photographs
// are trained on in more steps at once.
std::vector<int64_t> SlotPixels(const Backend& backend, const ReconstructOptions& options,
                                int64_t max_pixels);

// Does steps of stage one on the device (METHOD.md section 1): render, loss and backward pass of
// each, then Adam. The host is ahead of the device; Pop returns what a step reported once the
// device has finished it. To be used by one thread at a time. All that is passed to the constructor
// must outlive it.
class StepQueue {
 public:
  StepQueue(Backend& backend, const PreparedScene& scene, DepthTerm& depth_term,
            GaussianState& gaussians);

  // False: the backend is out of memory.
  bool allocated() const;
  // Number of steps on photographs at 1 / `shrink` of their size that may be done at once.
  int steps_at_once(int shrink) const;
  bool empty() const { return results_.empty(); }
  // True: Pop before the next Train.
  bool full() const { return results_.full(); }

  // Queues steps that are done at once: at least one, and as many as steps_at_once at
  // most, all at the same size. All find their gradients with the Gaussians as they are now.
  void Train(std::span<const StepInput> steps);
  // Returns the result of the oldest step; waits for it. A step whose render overflowed its
  // tile-entry capacity has changed nothing: it is queued again, now with as much as it needs, and
  // nothing is returned. empty() must be false.
  std::optional<StepResult> Pop();

 private:
  // Memory of one step from its render to its update.
  struct Slot {
    Slot(Backend& backend, int64_t max_pixels)
        : color(backend, 3 * max_pixels),
          color_grad(backend, 3 * max_pixels),
          loss_sums(backend, kNumLossSums) {}

    RenderScratch scratch;
    Buffer<float> color, color_grad;  // [3, H, W] of the largest view in it
    Buffer<double> loss_sums;         // [kNumLossSums]
  };

  static std::deque<Slot> MakeSlots(Backend& backend, const PreparedScene& scene);
  void Queue(std::span<const StepInput> steps, std::span<const int64_t> entry_capacities);
  void QueueGradient(const StepInput& input, int sh_degree, int64_t entry_capacity, Slot& slot);
  void QueueUpdates(std::span<const StepInput> steps);
  int ShDegreeAt(int position) const;

  Backend& backend_;
  const PreparedScene& scene_;
  DepthTerm& depth_term_;
  GaussianState& gaussians_;
  std::deque<Slot> slots_;  // one for each step that is done at once
  StepResults results_;
  TileEntryCapacities entry_capacities_;
};

}  // namespace pepeseg
