#pragma once

#include <array>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "core/base/stage.h"
#include "core/evaluate/image_scores.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Measurements of a training. Absent: not measured.
struct TrainingMetrics {
  using Number = std::optional<double>;

  Number num_photographs = {};
  Number num_views = {}, num_points = {}, num_masks = {}, num_depth_maps = {};  // of the capture
  Number num_registered = {};      // photographs whose pose stage "sfm" has found
  Number reprojection_error = {};  // of stage "sfm", pixels
  Number num_gaussians = {};
  Number psnr = {}, ssim = {}, lpips = {};  // means over the held-out views; the PSNR in dB
  Number mask_quality = {};                 // see MaskQuality
  // Step that stage one, and stage two, was resumed from. Absent: it began at step 0.
  Number resumed_from_step = {}, features_resumed_from_step = {};
  Number peak_device_bytes = {}, peak_memory_bytes = {};
  // By stage; absent: it did not run. Core seconds are those of the whole process and of its
  // children, such as SAM next to COLMAP.
  std::array<Number, kNumStages> seconds = {}, core_seconds = {};

  // Takes over what is measured in `other`.
  void Merge(const TrainingMetrics& other);
  // Returns what is measured, by the names of Model::metrics: those of the members, and
  // "seconds_STAGE" and "core_seconds_STAGE".
  std::map<std::string, double> ByName() const;
};

// Returns the mean scores; nothing is measured without scores.
TrainingMetrics MeansOf(std::span<const ViewScores> scores);
// Returns the numbers of views, points, masks and depth maps of a capture.
TrainingMetrics Counts(const Capture& capture);

}  // namespace pepeseg
