#include "core/sfm/find_features.h"

#include <algorithm>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/file_io.h"
#include "core/base/num_threads.h"
#include "core/base/status_macros.h"
#include "core/sfm/features/extract_features.h"

namespace pepeseg {
namespace {

// Maximum number of threads that extract features. Each takes kFeatureBytes a pixel (602 MB
// measured at 2.07 Mpx).
constexpr int kMostExtracting = 8;
constexpr int64_t kFeatureBytes = 300;

using Words = std::vector<std::string>;

// Returns the number of threads that extract features.
int NumExtracting(int num_threads) { return std::min(NumThreads(num_threads), kMostExtracting); }

// Returns features as the text that `colmap feature_importer` reads.
std::string FeatureText(const SfmFeatures& features) {
  std::string text = absl::StrCat(features.size(), " ", SfmFeatures::kDescriptorSize, "\n");
  for (size_t i = 0; i < features.size(); ++i) {
    const Keypoint& k = features.keypoints[i];
    absl::StrAppendFormat(&text, "%.9g %.9g %.9g %.9g", k.x, k.y, k.scale, k.angle);
    for (int j = 0; j < SfmFeatures::kDescriptorSize; ++j) {
      absl::StrAppend(&text, " ", features.descriptors[i * SfmFeatures::kDescriptorSize + j]);
    }
    text += "\n";
  }
  return text;
}

Words ReaderWords(const FeatureTask& task) {
  return {"--database_path", task.database.string(), "--image_path", task.images.string(),
          // On llff_fern and fox RADIAL gives the same camera centres. OPENCV takes 1.4 to 1.7
          // times as long to map, and may fit noise if there are few photographs.
          "--ImageReader.camera_model", "SIMPLE_RADIAL",  //
          "--ImageReader.single_camera_per_folder", "1"};
}

}  // namespace

absl::Status FindFeaturesByColmap(const FeatureTask& task, const ColmapProgram& program,
                                  SfmWatch& watch) {
  Words words = ReaderWords(task);
  words.insert(words.end(),
               {"--SiftExtraction.use_gpu", "0",  //
                "--SiftExtraction.max_image_size", std::to_string(kFeatureSide),
                "--SiftExtraction.num_threads", std::to_string(NumExtracting(task.num_threads)),
                "--SiftExtraction.max_num_features", std::to_string(task.max_features)});
  if (!task.masks.empty()) {
    words.insert(words.end(), {"--ImageReader.mask_path", task.masks.string()});
  }
  return watch.Run(program, {"feature_extractor", words, ""});
}

absl::Status FindOwnFeatures(const FeatureTask& task, Backend& backend,
                             const ColmapProgram& program, SfmWatch& watch) {
  std::vector<FeaturePhotograph> inputs;
  for (const SfmPhotograph& photograph : task.photographs) {
    inputs.push_back(
        {photograph.name, photograph.path, [&photograph] { return IgnoredPixels(photograph); }});
  }
  const auto take = [&](size_t index, const SfmFeatures& features) -> absl::Status {
    const std::string& name = task.safe_names[index];
    const std::filesystem::path text = task.texts / (name + ".txt");
    std::error_code error;
    std::filesystem::create_directories(text.parent_path(), error);
    RETURN_IF_ERROR(WriteFileAtomically(text, FeatureText(features)));
    watch.progress().Extract(name, static_cast<int64_t>(features.size()));
    return watch.ReportInTime("at finding features");
  };
  RETURN_IF_ERROR(
      ExtractFeatures(backend, inputs, {task.max_features, kFeatureSide, task.num_threads}, take));
  Words words = ReaderWords(task);
  words.insert(words.end(), {"--import_path", task.texts.string()});
  return watch.Run(program, {"feature_importer", words, ""});
}

int64_t FeatureHostBytes(int64_t max_pixels, int num_threads) {
  // Larger photographs are shrunk, see kFeatureSide.
  const int64_t pixels = std::min(max_pixels, int64_t{kFeatureSide} * kFeatureSide);
  return pixels * kFeatureBytes * NumExtracting(num_threads);
}

}  // namespace pepeseg
