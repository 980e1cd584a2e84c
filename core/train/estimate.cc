#include "core/train/estimate.h"

#include "core/dataset/video_frames.h"
#include "core/features/estimate.h"
#include "core/priors/sam/sam_segmenter.h"
#include "core/sfm/estimate_poses.h"

namespace pepeseg {
namespace {

// Bytes for each pixel of a photograph while it is decoded and undistorted, next to the capture.
constexpr int64_t kDecodingBytes = 16;

// Counts priors that will be made as if they had been uploaded. Built-in depth does not count: it
// is made from the points that stage one starts from and has no part in it.
void ExpectPriors(const PriorOptions& priors, bool has_command, TrainingSize& size) {
  const bool by_command =
      has_command && (priors.depth == PriorMaker::kAuto || priors.depth == PriorMaker::kCommand);
  if (size.num_masked_views == 0 && priors.masks != PriorMaker::kNone) {
    size.num_masked_views = size.num_views;
  }
  if (size.num_depth_views == 0 && by_command) size.num_depth_views = size.num_views;
}

StageNeed NeedOfFeatures(const Backend& backend, const DatasetSize& dataset,
                         const TrainingSettings& settings) {
  const TrainingSize& size = dataset.training;
  // The SH degree of given Gaussians is not known before they are read: the largest is assumed.
  const bool given = dataset.num_given_gaussians > 0;
  const int64_t num_gaussians =
      given ? dataset.num_given_gaussians : MostGaussians(size, settings.reconstruct);
  const int sh_degree = given ? kMaxShDegree : settings.reconstruct.sh_degree;
  const ScratchSize scratch = TypicalScratch(num_gaussians, size.max_pixels);
  StageNeed need{.stage = "features"};
  need.device_bytes = FeatureDeviceBytes(backend, scratch, sh_degree, settings.features);
  need.host_bytes = CaptureBytes(size) + FeatureHostBytes(scratch, sh_degree, settings.features);
  return need;
}

}  // namespace

std::vector<StageNeed> EstimateStages(const Backend& backend, DatasetSize dataset,
                                      const TrainingSettings& settings,
                                      const EstimateTools& tools) {
  TrainingSize& size = dataset.training;
  const bool by_sam = size.num_masked_views == 0 &&
                      ExpectsSam(settings.priors.masks, tools.has_priors_command, tools.has_sam);
  const bool on_device = !backend.memory().is_host;
  // The host's part is that of the CPU, which takes over where the device runs out of memory.
  const int64_t sam_bytes = by_sam ? SamHostBytes(tools.num_threads) : 0;
  const int64_t sam_device_bytes = by_sam && on_device ? SamDeviceBytes(size.max_pixels) : 0;
  ExpectPriors(settings.priors, tools.has_priors_command, size);
  std::vector<StageNeed> needs;
  // One need for each stage; stages that run one after the other do not add up.
  needs.push_back({.stage = "prepare",
                   .host_bytes = CaptureBytes(size) + kDecodingBytes * dataset.max_source_pixels});
  if (dataset.video_megapixels > 0) {
    needs.back().seconds = kVideoCoreSeconds * dataset.video_megapixels / tools.num_threads;
  }
  if (!dataset.has_poses) {
    // SAM runs next to COLMAP, and next to stage one.
    needs.push_back(
        {.stage = "sfm",
         .host_bytes =
             SfmHostBytes(dataset.max_source_pixels, /*num_threads=*/0, settings.sfm) + sam_bytes,
         .device_bytes = sam_device_bytes});
  }
  if (dataset.num_given_gaussians == 0) {
    const MemoryNeed need = EstimateReconstruct(backend, size, settings.reconstruct);
    needs.push_back({.stage = "reconstruct",
                     .host_bytes = need.host_bytes + sam_bytes,
                     .device_bytes = need.device_bytes + sam_device_bytes});
  }
  if (by_sam) {  // the time of other makers of priors is not known
    needs.push_back({.stage = "priors",
                     .host_bytes = CaptureBytes(size) + sam_bytes,
                     .device_bytes = sam_device_bytes,
                     .seconds = static_cast<double>(size.num_views) *
                                SamSeconds(tools.num_threads, on_device)});
  }
  if (size.num_masked_views > 0) needs.push_back(NeedOfFeatures(backend, dataset, settings));
  return needs;
}

}  // namespace pepeseg
