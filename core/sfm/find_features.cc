#include "core/sfm/find_features.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/num_threads.h"
#include "core/base/status_macros.h"
#include "core/sfm/features/extract_features.h"
#include "core/sfm/front/colmap_database.h"
#include "core/sfm/starting_cameras.h"

namespace pepeseg {
namespace {

// Maximum number of threads that extract features in COLMAP. Each takes kColmapBytes per pixel
// (602 MB measured at 2.07 Mpx).
constexpr int kMostExtracting = 8;
constexpr int64_t kColmapBytes = 300;
// Bytes per pixel of the one photograph in which own features are found (SiftScratch), and of each
// that is decoded.
constexpr int64_t kOwnBytes = 130;
constexpr int64_t kDecodingBytes = 12;
constexpr char kDatabaseVersion[] = "COLMAP 3.8";

using Words = std::vector<std::string>;

// Returns the number of threads that extract features in COLMAP.
int NumExtracting(int num_threads) { return std::min(NumThreads(num_threads), kMostExtracting); }

}  // namespace

absl::Status FindFeaturesByColmap(const FeatureTask& task, const ColmapProgram& program,
                                  SfmWatch& watch) {
  Words words = {"--database_path", task.database.string(), "--image_path", task.images.string(),
                 // On llff_fern and fox RADIAL gives the same camera centres. OPENCV takes 1.4
                 // to 1.7 times as long to map, and may fit noise if there are few photographs.
                 "--ImageReader.camera_model", "SIMPLE_RADIAL",                                   //
                 "--ImageReader.single_camera_per_folder", "1", "--SiftExtraction.use_gpu", "0",  //
                 "--SiftExtraction.max_image_size", std::to_string(kFeatureSide),
                 "--SiftExtraction.num_threads", std::to_string(NumExtracting(task.num_threads)),
                 "--SiftExtraction.max_num_features", std::to_string(task.max_features)};
  if (!task.masks.empty()) {
    words.insert(words.end(), {"--ImageReader.mask_path", task.masks.string()});
  }
  return watch.Run(program, {"feature_extractor", words, ""});
}

absl::Status FindOwnFeatures(const FeatureTask& task, Backend& backend,
                             const ColmapProgram& program, SfmWatch& watch) {
  if (program.version() != kDatabaseVersion) {
    return absl::FailedPreconditionError(absl::StrCat(
        "pepeseg writes databases of ", kDatabaseVersion, ", this is ", program.version()));
  }
  DatabaseFeatures found;
  found.cameras = StartingCameras(task.photographs);
  RETURN_IF_ERROR(
      LookUpSensors(task.photographs, task.images, task.sensors, program, watch, found.cameras));
  const std::vector<size_t> cameras = CameraIndices(task.photographs);
  std::vector<FeaturePhotograph> inputs;
  for (const SfmPhotograph& photograph : task.photographs) {
    inputs.push_back(
        {photograph.name, photograph.path, [&photograph] { return IgnoredPixels(photograph); }});
  }
  const auto take = [&](size_t index, SfmFeatures features) {
    watch.progress().Extract(task.safe_names[index], static_cast<int64_t>(features.size()));
    found.images.push_back({static_cast<int64_t>(index) + 1, task.safe_names[index], cameras[index],
                            std::move(features)});
    return watch.ReportInTime("at finding features");
  };
  RETURN_IF_ERROR(
      ExtractFeatures(backend, inputs, {task.max_features, kFeatureSide, task.num_threads}, take));
  return CreateDatabase(task.database, found);
}

int64_t FeatureHostBytes(int64_t max_pixels, int num_threads, bool by_colmap) {
  // Larger photographs are shrunk, see kFeatureSide.
  const int64_t shrunk = std::min(max_pixels, int64_t{kFeatureSide} * kFeatureSide);
  if (by_colmap) return shrunk * kColmapBytes * NumExtracting(num_threads);
  return shrunk * kOwnBytes + max_pixels * kDecodingBytes * NumDecoding(num_threads);
}

}  // namespace pepeseg
