#pragma once

#include <vector>

#include "core/features/row_chunk.h"
#include "kernels/buffer.h"

namespace pepeseg {

// Maximum number of steps whose losses stay on the device before the host waits for them.
inline constexpr int kMaxUnreadFeatureSteps = 64;

// A loss of stage two besides the pair loss, to whose gradients it adds its own.
class LossTerm {
 public:
  // The inputs of a term and the gradients that it adds to, in backend memory. S pixels, the
  // labelled ones first.
  struct Spans {
    DeviceSpan<const float> pixel_features;  // [S, 32]
    DeviceSpan<const float> gate;            // see CentroidLossArgs
    DeviceSpan<float> pixel_grad;            // [S, 32] added to
    DeviceSpan<float> gate_grad;             // as gate; added to
  };

  virtual ~LossTerm() = default;

  // Returns whether the step has this loss.
  virtual bool IsIn(const RowChunk::Step& step) const = 0;
  // Queues the loss of a step that has it: adds its gradients, and keeps the loss for ReadLosses
  // in the slot `unread_step`, in [0, kMaxUnreadFeatureSteps).
  virtual void AddGradients(const RowChunk::Step& step, const Spans& spans, int unread_step) = 0;
  // Returns the weighted losses of the slots 0 .. num_steps - 1, 0 for steps that did not have the
  // loss. Waits for the device.
  virtual std::vector<double> ReadLosses(int num_steps) = 0;
};

}  // namespace pepeseg
