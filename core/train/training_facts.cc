#include "core/train/training_facts.h"

#include <algorithm>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/num_threads.h"
#include "core/dataset/dataset_files.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/video_frames.h"
#include "core/formats/image_header.h"
#include "core/formats/movie_size.h"

namespace pepeseg {
namespace {

// Returns the mean size in megapixels of photographs, evenly spread over the list, since those of
// one camera lie next to each other; 1 if none can be read, which a later stage reports.
double MeanMegapixels(const std::vector<DatasetFile>& files) {
  constexpr size_t kMostHeaders = 48;
  std::vector<const DatasetFile*> photographs;
  for (const DatasetFile& file : files) {
    if (file.kind == FileKind::kImage) photographs.push_back(&file);
  }
  const size_t num_read = std::min(photographs.size(), kMostHeaders);
  double sum = 0;
  int num_known = 0;
  for (size_t i = 0; i < num_read; ++i) {
    const DatasetFile& file = *photographs[i * photographs.size() / num_read];
    const absl::StatusOr<ImageHeader> header = ReadImageSize(file.path, file.name);
    if (!header.ok()) continue;
    sum += 1e-6 * static_cast<double>(header->width) * header->height;
    ++num_known;
  }
  return num_known > 0 ? sum / num_known : 1;
}

}  // namespace

TrainingFacts FactsOf(const TrainingInputs& inputs, const TrainingSettings& settings,
                      bool on_device) {
  TrainingFacts facts;
  facts.has_priors_command = !inputs.tools.priors_command.program.empty();
  facts.has_sam = !inputs.tools.sam.empty();
  facts.on_device = on_device;
  facts.has_lpips = !inputs.tools.lpips_weights.empty();
  facts.num_threads = NumThreads(inputs.tools.num_threads);
  for (const DatasetFile& file : inputs.files) {
    facts.has_poses |= file.kind == FileKind::kPoses;
    facts.has_depth |= settings.import.use_depth &&
                       (file.kind == FileKind::kDepth || file.kind == FileKind::kDisparity);
    facts.has_gaussians |= file.kind == FileKind::kGaussians;
    facts.num_photographs += file.kind == FileKind::kImage ? 1 : 0;
  }
  facts.has_masks = settings.import.use_masks && CountSegmentMasks(inputs.files) > 0;
  // Without photographs among the files there are only frames.
  facts.is_video = facts.num_photographs == 0;
  const int64_t max_frames = settings.sfm.max_video_frames;
  for (const DatasetFile& file : inputs.files) {
    if (file.kind != FileKind::kVideo) continue;
    const MovieSize movie = ReadMovieSize(file.path);
    facts.num_photographs += ExpectedFrames(movie.num_frames, max_frames);
    facts.video_megapixels +=
        1e-6 * static_cast<double>(movie.num_frames) * movie.width * movie.height;
  }
  const double scale = settings.import.image_scale;
  facts.photo_megapixels = MeanMegapixels(inputs.files);
  facts.megapixels = facts.photo_megapixels * scale * scale;
  return facts;
}

void SetViews(const Capture& capture, TrainingFacts& facts) {
  if (capture.views.empty()) return;
  double pixels = 0;
  for (const View& view : capture.views) {
    pixels += static_cast<double>(view.photo.width) * view.photo.height;
  }
  facts.num_photographs = static_cast<int64_t>(capture.views.size());
  facts.megapixels = pixels * 1e-6 / static_cast<double>(capture.views.size());
}

}  // namespace pepeseg
