#pragma once

#include <cstdint>

#include "core/reconstruct/options.h"
#include "core/scene/capture.h"
#include "kernels/backend.h"
#include "kernels/buffer.h"

namespace pepeseg {

// Size of a training, known before a photograph is decoded. Pixels are counted at the size that is
// trained on.
struct TrainingSize {
  int64_t num_views = 0;  // with held-out ones
  int64_t num_training_views = 0;
  int64_t num_pixels = 0;        // in all views
  int64_t max_pixels = 0;        // in the largest view
  int64_t num_points = 0;        // 0: the training starts from random points
  int64_t num_masked_views = 0;  // views with masks
  int64_t num_ignore_views = 0;  // views with an ignore mask
  int64_t num_depth_views = 0;   // views with a depth prior
};

// Peak memory of a stage. On the CPU backend both parts come out of the host's memory.
struct MemoryNeed {
  int64_t device_bytes = 0;  // allocated by Backend::Allocate
  int64_t host_bytes = 0;    // allocated otherwise
  // Part of device_bytes that the host may hold instead: photographs, priors and masks.
  int64_t movable_bytes = 0;
};

// Returns the need where photographs are kept on the host.
MemoryNeed WithPhotographsOnHost(MemoryNeed need);

// Returns the size of a capture.
TrainingSize SizeOf(const Capture& capture);

// Returns the largest number of Gaussians that density control allows.
int64_t MostGaussians(const TrainingSize& size, const ReconstructOptions& options);

// Returns the size of the capture in host memory, bytes.
int64_t CaptureBytes(const TrainingSize& size);

// Returns an upper estimate of what stage one allocates, with as many Gaussians as its options
// allow.
MemoryNeed EstimateReconstruct(const Backend& backend, const TrainingSize& size,
                               const ReconstructOptions& options);

// Returns where stage one keeps photographs and masks: on the device if this has room for all that
// the stage needs, unless the options demand the host.
MemoryPlace PhotographPlace(const Backend& backend, const TrainingSize& size,
                            const ReconstructOptions& options);

}  // namespace pepeseg
