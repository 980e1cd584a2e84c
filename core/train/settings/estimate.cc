#include "core/train/settings/estimate.h"

#include <algorithm>

#include "core/dataset/view_reader.h"
#include "core/features/estimate.h"
#include "core/priors/sam/sam_segmenter.h"
#include "core/render/renderer.h"
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

// Sets the memory of the stages that need a notable amount of it.
class MemoryEstimator {
 public:
  MemoryEstimator(const Backend& backend, const DatasetSize& dataset,
                  const TrainingSettings& settings, const MemoryNeed& sam,
                  const EstimateTools& tools)
      : backend_(backend), dataset_(dataset), settings_(settings), sam_(sam), tools_(tools) {}

  // Stages that run one after the other do not add up, but SAM runs next to "sfm" and
  // "reconstruct".
  void Estimate(StageNeed& need) const {
    const TrainingSize& size = dataset_.training;
    const int64_t capture_bytes = CaptureBytes(size);
    switch (need.stage) {
      case Stage::kPrepare:
        need.host_bytes =
            capture_bytes + kDecodingBytes * dataset_.max_source_pixels *
                                NumReaders(dataset_.max_source_pixels, tools_.num_threads);
        return;
      case Stage::kSfm:
        need.host_bytes =
            SfmHostBytes(dataset_.max_source_pixels, /*num_threads=*/0, settings_.sfm) +
            sam_.host_bytes;
        need.device_bytes = sam_.device_bytes;
        return;
      case Stage::kReconstruct: {
        MemoryNeed memory = EstimateReconstruct(backend_, size, settings_.reconstruct);
        const int64_t have = tools_.device_memory;
        if (have > 0 && memory.device_bytes + sam_.device_bytes > have) {
          memory = WithPhotographsOnHost(memory);
        }
        need.host_bytes = memory.host_bytes + sam_.host_bytes;
        need.device_bytes = memory.device_bytes + sam_.device_bytes;
        return;
      }
      case Stage::kPriors:
        need.host_bytes = capture_bytes + sam_.host_bytes;
        need.device_bytes = sam_.device_bytes;
        return;
      case Stage::kFeatures:
        return EstimateFeatures(need);
      case Stage::kEvaluate:
      case Stage::kIndex:
        return;
    }
  }

 private:
  void EstimateFeatures(StageNeed& need) const {
    const TrainingSize& size = dataset_.training;
    // The SH degree of given Gaussians is not known before they are read: the largest is assumed.
    const bool given = dataset_.num_given_gaussians > 0;
    const int64_t num_gaussians =
        given ? dataset_.num_given_gaussians : MostGaussians(size, settings_.reconstruct);
    const int sh_degree = given ? kMaxShDegree : settings_.reconstruct.sh_degree;
    const ScratchSize scratch = TypicalScratch(num_gaussians, size.max_pixels);
    need.device_bytes = FeatureDeviceBytes(backend_, scratch, sh_degree, settings_.features);
    need.host_bytes = CaptureBytes(size) + FeatureHostBytes(scratch, sh_degree, settings_.features);
  }

  const Backend& backend_;
  const DatasetSize& dataset_;
  const TrainingSettings& settings_;
  MemoryNeed sam_;
  const EstimateTools& tools_;
};

}  // namespace

TrainingFacts FactsOf(const Backend& backend, const DatasetSize& dataset,
                      const TrainingSettings& settings, const EstimateTools& tools) {
  const TrainingSize& size = dataset.training;
  TrainingFacts facts;
  facts.has_poses = dataset.has_poses;
  facts.has_masks = size.num_masked_views > 0;
  facts.has_depth = size.num_depth_views > 0;
  facts.has_gaussians = dataset.num_given_gaussians > 0;
  facts.is_video = dataset.is_video;
  facts.has_priors_command = tools.has_priors_command;
  facts.has_sam = tools.has_sam;
  facts.has_lpips = tools.has_lpips;
  facts.on_device = !backend.memory().is_host;
  facts.num_threads = tools.num_threads;
  facts.num_photographs = size.num_views;
  facts.video_megapixels = dataset.video_megapixels;
  const double scale = settings.import.image_scale;
  const auto num_views = static_cast<double>(std::max<int64_t>(1, size.num_views));
  facts.megapixels = 1e-6 * static_cast<double>(size.num_pixels) / num_views;
  facts.photo_megapixels = facts.megapixels / (scale * scale);
  return facts;
}

std::vector<StageNeed> EstimateStages(const Backend& backend, DatasetSize dataset,
                                      const TrainingSettings& settings,
                                      const EstimateTools& tools) {
  const std::vector<PlannedStage> plan =
      PlanStages(FactsOf(backend, dataset, settings, tools), settings);
  const bool by_sam = dataset.training.num_masked_views == 0 &&
                      ExpectsSam(settings.priors.masks, tools.has_priors_command, tools.has_sam);
  ExpectPriors(settings.priors, tools.has_priors_command, dataset.training);
  MemoryNeed sam;
  if (by_sam) {
    // The host's part is that of the CPU, which takes over where the device runs out of memory.
    sam.host_bytes = SamHostBytes(tools.num_threads);
    const bool on_device = !backend.memory().is_host;
    sam.device_bytes = on_device ? SamDeviceBytes(dataset.training.max_pixels) : 0;
  }
  const MemoryEstimator memory(backend, dataset, settings, sam, tools);
  std::vector<StageNeed> needs;
  needs.reserve(plan.size());
  for (const PlannedStage& stage : plan) {
    memory.Estimate(needs.emplace_back(StageNeed{.stage = stage.stage, .seconds = stage.seconds}));
  }
  return needs;
}

}  // namespace pepeseg
