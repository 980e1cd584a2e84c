#pragma once

#include <cstdint>

#include "core/reconstruct/reconstruct.h"
#include "kernels/backend.h"

namespace pepeseg {

// What a training works on, known before a photograph is decoded. Pixels are of the size that is
// trained on.
struct TrainingSize {
  int64_t num_views = 0;  // held-out ones too
  int64_t num_training_views = 0;
  int64_t num_pixels = 0;        // of all views
  int64_t max_pixels = 0;        // of the largest view
  int64_t num_points = 0;        // 0: none, Gaussians begin at random ones
  int64_t num_masked_views = 0;  // with masks to learn features from
  int64_t num_ignore_views = 0;  // with pixels to leave out
  int64_t num_depth_views = 0;   // with a depth map
};

// Peak of a stage. On a device that is the host, both come out of one memory.
struct MemoryNeed {
  int64_t device_bytes = 0;  // of Backend::Allocate
  int64_t host_bytes = 0;    // beside it
};

// Gaussians that stage one can end with.
int64_t MostGaussians(const TrainingSize& size, const ReconstructOptions& options);

// A render of one view by so many Gaussians, all in sight. The overlap of Gaussians that it
// supposes is above what scenes showed here; one of large, faint Gaussians may have more.
ScratchSize TypicalScratch(int64_t num_gaussians, int64_t num_pixels);

// The capture in the host's memory.
int64_t CaptureBytes(const TrainingSize& size);

// Bounds what stage one allocates, at the most Gaussians that its options allow.
MemoryNeed EstimateReconstruct(const Backend& backend, const TrainingSize& size,
                               const ReconstructOptions& options);

}  // namespace pepeseg
