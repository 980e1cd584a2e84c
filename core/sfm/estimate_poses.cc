#include "core/sfm/estimate_poses.h"

#include <algorithm>
#include <map>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/model_files/manifest.h"
#include "core/sfm/colmap_program.h"
#include "core/sfm/sfm_model.h"
#include "core/sfm/sfm_verdict.h"

namespace pepeseg {
namespace {

// Maximum number of photographs of which all pairs are compared (about 20,000 pairs).
constexpr size_t kMostExhaustive = 200;
// Photographs are shrunk to this longer side before features are extracted. Few of the 3000 largest
// features are lost by that.
constexpr int kFeatureSide = 2000;
// Maximum number of threads that extract features. Each takes kFeatureBytes a pixel (602 MB
// measured at 2.07 Mpx).
constexpr int kMostExtracting = 8;
constexpr int64_t kFeatureBytes = 300;
constexpr char kProgramFile[] = "program.txt";

using Words = std::vector<std::string>;

// Creates an empty folder, after removing one of that name.
absl::Status MakeEmptyFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::remove_all(folder, error);
  if (!error) std::filesystem::create_directories(folder, error);
  if (!error) return absl::OkStatus();
  return absl::InternalError(absl::StrCat("cannot make ", folder.string(), ": ", error.message()));
}

// Removes a folder when it goes out of scope.
struct Removal {
  ~Removal() {
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);
  }
  const std::filesystem::path& folder;
};

// Returns the number of threads that extract features.
int NumExtracting(int num_threads) {
  const int num_cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  // 0 threads: one for each core.
  return std::min(num_threads > 0 ? num_threads : num_cores, kMostExtracting);
}

ColmapProgress ProgressOf(int64_t num_photographs, bool sequential, const SfmOptions& options) {
  const int64_t num_pairs = NumSfmPairs(num_photographs, sequential, options);
  return {num_photographs, num_pairs, ExpectedSfmWork(num_photographs, num_pairs, options)};
}

// One run of the stage. EstimatePoses calls the public methods in their order.
class PoseEstimation {
 public:
  PoseEstimation(std::span<const SfmPhotograph> photographs, const SfmPlaces& places,
                 const SfmOptions& options, ProgressFn progress)
      : photographs_(photographs),
        places_(places),
        options_(options),
        on_progress_(progress),
        deadline_(absl::Now() + absl::Seconds(options.max_seconds)),
        safe_names_(SafeNames(photographs)),
        progress_(
            ProgressOf(static_cast<int64_t>(photographs.size()), MatchesSequentially(), options)) {}

  absl::Status OpenProgram();
  absl::Status LayOutPhotographs();
  absl::Status ExtractFeatures();
  absl::Status MatchFeatures();
  absl::Status Map();
  absl::Status KeepLargestModel();

 private:
  absl::Status Run(const ColmapProgram::Command& command);
  absl::Status Report();
  bool MatchesSequentially() const;
  Words MatchingWords() const;
  SfmEvidence Evidence() const;
  // Returns the option for COLMAP; -1: one thread for each core.
  std::string Threads() const {
    return std::to_string(places_.num_threads > 0 ? places_.num_threads : -1);
  }
  std::string Database() const { return (places_.work / "database.db").string(); }
  std::string Images() const { return (places_.work / "images").string(); }

  std::span<const SfmPhotograph> photographs_;
  const SfmPlaces& places_;
  const SfmOptions& options_;
  ProgressFn on_progress_;
  absl::Time deadline_;
  std::vector<std::string> safe_names_;  // names of the photographs in COLMAP, see SafeNames
  ColmapProgress progress_;
  std::optional<ColmapProgram> program_;
  bool any_mask_ = false;
  std::vector<SfmModel> models_;
};

absl::Status PoseEstimation::Report() {
  StepReport report;
  report.stage = "sfm";
  report.step = progress_.step();
  report.num_steps = progress_.num_steps();
  report.activity = progress_.activity();
  report.unit = progress_.unit();
  report.share = progress_.share();
  return on_progress_(report);
}

// Runs a command and reports its progress. Explains a timeout in terms of the options.
absl::Status PoseEstimation::Run(const ColmapProgram::Command& command) {
  absl::Status status =
      program_->Run(command, deadline_, [this](std::span<const std::string> lines) {
        for (const std::string& line : lines) progress_.Read(line);
        return Report();
      });
  if (!absl::IsDeadlineExceeded(status)) return status;
  return absl::DeadlineExceededError(absl::StrCat(
      "poses of ", photographs_.size(), " photographs were not found within ", options_.max_seconds,
      " s (sfm.max_seconds), COLMAP was at its ", command.name,
      ": allow more, upload fewer photographs, or have fewer features (sfm.max_features)"));
}

absl::Status PoseEstimation::OpenProgram() {
  ASSIGN_OR_RETURN(program_, ColmapProgram::Open(places_.program, places_.log));
  return absl::OkStatus();
}

absl::Status PoseEstimation::LayOutPhotographs() {
  ASSIGN_OR_RETURN(any_mask_, LayOut(photographs_, Images(), places_.work / "masks"));
  return absl::OkStatus();
}

absl::Status PoseEstimation::ExtractFeatures() {
  Words words = {"--database_path", Database(), "--image_path", Images(),
                 // On llff_fern and fox RADIAL gives the same camera centres. OPENCV takes 1.4 to
                 // 1.7 times as long to map, and may fit noise if there are few photographs.
                 "--ImageReader.camera_model", "SIMPLE_RADIAL",
                 "--ImageReader.single_camera_per_folder", "1",  //
                 "--SiftExtraction.use_gpu", "0",                //
                 "--SiftExtraction.max_image_size", std::to_string(kFeatureSide),
                 "--SiftExtraction.num_threads",
                 std::to_string(NumExtracting(places_.num_threads)),  //
                 "--SiftExtraction.max_num_features", std::to_string(options_.max_features)};
  if (any_mask_) {
    words.insert(words.end(), {"--ImageReader.mask_path", (places_.work / "masks").string()});
  }
  RETURN_IF_ERROR(Run({"feature_extractor", words, ""}));
  return JudgeFeatures(Evidence(), options_);
}

// By default, frames of a video are matched sequentially, and numbered photographs as well if there
// are too many to compare all pairs.
bool PoseEstimation::MatchesSequentially() const {
  if (options_.matching != SfmMatching::kByCapture) {
    return options_.matching == SfmMatching::kSequential;
  }
  const bool frames =
      std::all_of(photographs_.begin(), photographs_.end(),
                  [](const SfmPhotograph& photograph) { return photograph.is_video_frame; });
  return frames || (photographs_.size() > kMostExhaustive && AreNumbered(photographs_));
}

Words PoseEstimation::MatchingWords() const {
  if (MatchesSequentially()) {
    return {"--SequentialMatching.overlap", std::to_string(options_.sequential_overlap),
            "--SequentialMatching.quadratic_overlap", "1"};
  }
  // The matcher reports after each block, so about ten times ten blocks make a smooth progress.
  const size_t block = std::clamp<size_t>(photographs_.size() / 10, 5, 50);
  return {"--ExhaustiveMatching.block_size", std::to_string(block)};
}

absl::Status PoseEstimation::MatchFeatures() {
  Words words = {
      "--database_path", Database(), "--SiftMatching.use_gpu", "0", "--SiftMatching.num_threads",
      Threads()};
  const Words chosen = MatchingWords();
  words.insert(words.end(), chosen.begin(), chosen.end());
  return Run({MatchesSequentially() ? "sequential_matcher" : "exhaustive_matcher", words, ""});
}

absl::Status PoseEstimation::Map() {
  const std::filesystem::path models = places_.work / "models";
  std::error_code error;
  std::filesystem::create_directory(models, error);
  // random_seed: RANSAC is repeatable with one thread. min_model_size: by default COLMAP drops
  // small models, but JudgeModels needs them to find a second place.
  const Words words = {
      "--random_seed",        "1",       "--database_path",         Database(),
      "--image_path",         Images(),  "--output_path",           models.string(),
      "--Mapper.num_threads", Threads(), "--Mapper.min_model_size", "3"};
  RETURN_IF_ERROR(Run({"mapper", words, "failed to create sparse model"}));
  ASSIGN_OR_RETURN(models_, ReadSfmModels(models));
  return JudgeModels(Evidence(), options_);
}

// Collects what is known so far, with the owner's names in place of COLMAP's.
SfmEvidence PoseEstimation::Evidence() const {
  SfmEvidence evidence;
  std::map<std::string, size_t> index;
  for (size_t i = 0; i < photographs_.size(); ++i) {
    evidence.names.push_back(photographs_[i].name);
    const auto features = progress_.num_features().find(safe_names_[i]);
    // A photograph that COLMAP could not read has no entry.
    evidence.num_features.push_back(features == progress_.num_features().end() ? 0
                                                                               : features->second);
    index[safe_names_[i]] = i;
  }
  evidence.num_connected = progress_.num_connected();
  // Models hold COLMAP's names, the verdict speaks of photographs by index.
  for (const SfmModel& model : models_) {
    std::vector<size_t>& members = evidence.models.emplace_back();
    for (const std::string& name : model.names) {
      if (const auto found = index.find(name); found != index.end()) {
        members.push_back(found->second);
      }
    }
  }
  return evidence;
}

// Writes the result. The manifest comes last: without it ReadEstimatedPoses returns NOT_FOUND.
absl::Status PoseEstimation::KeepLargestModel() {
  std::map<std::string, std::string> names;
  for (size_t i = 0; i < photographs_.size(); ++i) names[safe_names_[i]] = photographs_[i].name;
  RETURN_IF_ERROR(MakeEmptyFolder(places_.result));
  RETURN_IF_ERROR(CopyRenamed(models_.front(), names, places_.result));
  RETURN_IF_ERROR(WriteFileAtomically(places_.result / kProgramFile, program_->version() + "\n"));
  const Words files = {"cameras.bin", "images.bin", "points3D.bin", kProgramFile};
  ASSIGN_OR_RETURN(const Manifest manifest, BuildManifest(places_.result, files));
  RETURN_IF_ERROR(WriteManifest(places_.result, manifest));
  progress_.Finish();
  return Report();
}

}  // namespace

absl::StatusOr<EstimatedPoses> EstimatePoses(std::span<const SfmPhotograph> photographs,
                                             const SfmPlaces& places, const SfmOptions& options,
                                             ProgressFn progress) {
  RETURN_IF_ERROR(Validate(options));
  RETURN_IF_ERROR(CheckEnough(photographs));
  PoseEstimation estimation(photographs, places, options, progress);
  RETURN_IF_ERROR(estimation.OpenProgram());
  // From here on the working folder is removed on every way out: it holds copies of the
  // photographs.
  const Removal removal{places.work};
  RETURN_IF_ERROR(MakeEmptyFolder(places.work));
  RETURN_IF_ERROR(estimation.LayOutPhotographs());
  RETURN_IF_ERROR(estimation.ExtractFeatures());
  RETURN_IF_ERROR(estimation.MatchFeatures());
  RETURN_IF_ERROR(estimation.Map());
  RETURN_IF_ERROR(estimation.KeepLargestModel());
  return ReadEstimatedPoses(places.result);
}

int64_t SfmHostBytes(int64_t max_pixels, int num_threads) {
  // COLMAP shrinks larger photographs before it extracts, see kFeatureSide.
  const int64_t pixels = std::min(max_pixels, int64_t{kFeatureSide} * kFeatureSide);
  return pixels * kFeatureBytes * NumExtracting(num_threads);
}

absl::StatusOr<EstimatedPoses> ReadEstimatedPoses(const std::filesystem::path& result) {
  // The digests are compared: a result that was cut short or damaged is not used.
  ASSIGN_OR_RETURN(const Manifest manifest, ReadManifest(result));
  RETURN_IF_ERROR(VerifyManifest(result, manifest));
  ASSIGN_OR_RETURN(const SfmModel model, ReadSfmModel(result));
  EstimatedPoses poses{
      result / "cameras.bin", result / "images.bin", result / "points3D.bin", "", 0, 0};
  const std::filesystem::path program = result / kProgramFile;
  ASSIGN_OR_RETURN(poses.program, ReadFile(program, program.string(), 1024));
  poses.program.erase(std::min(poses.program.find('\n'), poses.program.size()));
  poses.num_registered = static_cast<int64_t>(model.names.size());
  poses.reprojection_error = model.reprojection_error;
  return poses;
}

}  // namespace pepeseg
