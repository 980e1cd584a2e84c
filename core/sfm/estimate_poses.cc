#include "core/sfm/estimate_poses.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "core/base/file_io.h"
#include "core/base/num_threads.h"
#include "core/base/status_macros.h"
#include "core/model_files/manifest.h"
#include "core/sfm/colmap_program.h"
#include "core/sfm/features/extract_features.h"
#include "core/sfm/front/compare_photographs.h"
#include "core/sfm/incremental_mapping.h"
#include "core/sfm/sfm_model.h"
#include "core/sfm/sfm_progress.h"
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
int NumExtracting(int num_threads) { return std::min(NumThreads(num_threads), kMostExtracting); }

// By default, frames of a video are matched in sequence; so are numbered photographs where COLMAP
// matches and there are too many to compare all pairs.
SfmLoad LoadOf(std::span<const SfmPhotograph> photographs, const SfmOptions& options,
               bool on_device) {
  SfmLoad load{.num_photographs = static_cast<int64_t>(photographs.size()), .on_device = on_device};
  double pixels = 0;
  load.in_sequence = !photographs.empty();
  for (const SfmPhotograph& photograph : photographs) {
    pixels += static_cast<double>(photograph.header.width) * photograph.header.height;
    load.in_sequence &= photograph.is_video_frame;
  }
  load.megapixels = 1e-6 * pixels / static_cast<double>(std::max<size_t>(photographs.size(), 1));
  load.in_sequence |= options.front == SfmEngine::kColmap && photographs.size() > kMostExhaustive &&
                      AreNumbered(photographs);
  return load;
}

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

// One run of the stage. EstimatePoses calls the public methods in their order.
class PoseEstimation {
 public:
  PoseEstimation(std::span<const SfmPhotograph> photographs, const SfmPlaces& places,
                 const SfmOptions& options, const SfmRun& run)
      : photographs_(photographs),
        places_(places),
        options_(options),
        run_(run),
        deadline_(absl::Now() + absl::Seconds(options.max_seconds)),
        safe_names_(SafeNames(photographs)),
        load_(LoadOf(photographs, options, !run.backend.memory().is_host)),
        progress_(load_.num_photographs, NumSfmPairs(load_, options).compared,
                  ExpectedSfmWork(load_, options)) {}

  absl::Status OpenProgram();
  absl::Status LayOutPhotographs();
  absl::Status ExtractFeatures();
  absl::Status MatchFeatures();
  absl::Status Map();
  absl::Status KeepLargestModel();

 private:
  absl::Status Run(const ColmapProgram::Command& command);
  absl::Status ExtractByColmap();
  absl::Status ExtractByOwnFeatures();
  Words ReaderWords() const;
  absl::Status MatchByOwnFront();
  absl::Status MatchByColmap();
  absl::Status TookTooLong(const std::string& doing) const;
  absl::Status Report();
  bool MatchesSequentially() const {
    return ComparisonFor(load_, options_).choice == PairChoice::kInSequence;
  }
  Words MatchingWords() const;
  SfmEvidence Evidence() const;
  std::vector<size_t> IndicesOf(const Words& names) const;
  // Returns the option for COLMAP; -1: one thread for each core.
  std::string Threads() const {
    return std::to_string(places_.num_threads > 0 ? places_.num_threads : -1);
  }
  std::string Database() const { return (places_.work / "database.db").string(); }
  std::string OwnDatabase() const { return (places_.work / "own.db").string(); }
  std::string Images() const { return (places_.work / "images").string(); }

  std::span<const SfmPhotograph> photographs_;
  const SfmPlaces& places_;
  const SfmOptions& options_;
  const SfmRun& run_;
  absl::Time deadline_;
  std::vector<std::string> safe_names_;  // names of the photographs in COLMAP, see SafeNames
  SfmLoad load_;
  SfmProgress progress_;
  std::optional<ColmapProgram> program_;
  bool any_mask_ = false;
  std::optional<ComparedDatabase> compared_;  // if the own front has written OwnDatabase()
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
  return run_.progress(report);
}

// Runs a command and reports its progress. Explains a timeout in terms of the options.
absl::Status PoseEstimation::Run(const ColmapProgram::Command& command) {
  absl::Status status =
      program_->Run(command, deadline_, [this](std::span<const std::string> lines) {
        for (const std::string& line : lines) progress_.Read(line);
        return Report();
      });
  if (!absl::IsDeadlineExceeded(status)) return status;
  return TookTooLong("COLMAP was at its " + command.name);
}

absl::Status PoseEstimation::TookTooLong(const std::string& doing) const {
  return absl::DeadlineExceededError(absl::StrCat(
      "poses of ", photographs_.size(), " photographs were not found within ", options_.max_seconds,
      " s (sfm.max_seconds), ", doing,
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
  RETURN_IF_ERROR(options_.features == SfmEngine::kOwn ? ExtractByOwnFeatures()
                                                       : ExtractByColmap());
  return JudgeFeatures(Evidence(), options_);
}

Words PoseEstimation::ReaderWords() const {
  return {"--database_path", Database(), "--image_path", Images(),
          // On llff_fern and fox RADIAL gives the same camera centres. OPENCV takes 1.4 to 1.7
          // times as long to map, and may fit noise if there are few photographs.
          "--ImageReader.camera_model", "SIMPLE_RADIAL",  //
          "--ImageReader.single_camera_per_folder", "1"};
}

absl::Status PoseEstimation::ExtractByColmap() {
  Words words = ReaderWords();
  words.insert(words.end(),
               {"--SiftExtraction.use_gpu", "0",  //
                "--SiftExtraction.max_image_size", std::to_string(kFeatureSide),
                "--SiftExtraction.num_threads", std::to_string(NumExtracting(places_.num_threads)),
                "--SiftExtraction.max_num_features", std::to_string(options_.max_features)});
  if (any_mask_) {
    words.insert(words.end(), {"--ImageReader.mask_path", (places_.work / "masks").string()});
  }
  return Run({"feature_extractor", words, ""});
}

// COLMAP imports the features as text, so that it chooses cameras and focal lengths as ever.
absl::Status PoseEstimation::ExtractByOwnFeatures() {
  std::vector<FeaturePhotograph> inputs;
  for (const SfmPhotograph& photograph : photographs_) {
    inputs.push_back(
        {photograph.name, photograph.path, [&photograph] { return IgnoredPixels(photograph); }});
  }
  const SfmFeatureOptions options{options_.max_features, kFeatureSide, places_.num_threads};
  const std::filesystem::path texts = places_.work / "features";
  const auto take = [&](size_t index, const SfmFeatures& features) -> absl::Status {
    if (absl::Now() > deadline_) return TookTooLong("at finding features");
    const std::filesystem::path text = texts / (safe_names_[index] + ".txt");
    std::error_code error;
    std::filesystem::create_directories(text.parent_path(), error);
    RETURN_IF_ERROR(WriteFileAtomically(text, FeatureText(features)));
    progress_.Extract(safe_names_[index], static_cast<int64_t>(features.size()));
    return Report();
  };
  RETURN_IF_ERROR(pepeseg::ExtractFeatures(run_.backend, inputs, options, take));
  Words words = ReaderWords();
  words.insert(words.end(), {"--import_path", texts.string()});
  return Run({"feature_importer", words, ""});
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
  if (options_.front == SfmEngine::kColmap) return MatchByColmap();
  return MatchByOwnFront();
}

// With SfmEngine::kAuto, COLMAP does it if the own front fails, as with a database of another
// version.
absl::Status PoseEstimation::MatchByOwnFront() {
  ComparisonOptions comparison = ComparisonFor(load_, options_);
  comparison.feature_side = kFeatureSide;
  comparison.num_threads = places_.num_threads;
  // Set when the caller or the deadline ends the comparison. The front has not failed then.
  absl::Status stopped;
  absl::StatusOr<ComparedDatabase> compared = CompareInDatabase(
      run_.backend, Database(), OwnDatabase(), comparison, [&](const ComparisonProgress& progress) {
        if (progress.choosing) {
          progress_.Score(progress.done, progress.total);
        } else {
          progress_.Compare(progress.done, progress.total);
        }
        stopped = absl::Now() > deadline_ ? TookTooLong("at matching features") : Report();
        return stopped;
      });
  if (compared.ok()) {
    compared_ = *std::move(compared);
    return absl::OkStatus();
  }
  if (!stopped.ok() || options_.front == SfmEngine::kOwn) return compared.status();
  run_.warn(
      absl::StrCat("COLMAP matches the photographs, which takes longer, because pepeseg's "
                   "matcher failed: ",
                   compared.status().message()));
  return MatchByColmap();
}

absl::Status PoseEstimation::MatchByColmap() {
  Words words = {
      "--database_path", Database(), "--SiftMatching.use_gpu", "0", "--SiftMatching.num_threads",
      Threads()};
  const Words chosen = MatchingWords();
  words.insert(words.end(), chosen.begin(), chosen.end());
  return Run({MatchesSequentially() ? "sequential_matcher" : "exhaustive_matcher", words, ""});
}

absl::Status PoseEstimation::Map() {
  MappingInput input{compared_ ? OwnDatabase() : Database(), Images(), places_.work / "models",
                     Threads(), compared_ ? &*compared_ : nullptr};
  RETURN_IF_ERROR(MakeEmptyFolder(input.models));
  ASSIGN_OR_RETURN(MappedModels mapped,
                   MapIncrementally(input, [this](const auto& command) { return Run(command); }));
  models_ = std::move(mapped.models);
  RETURN_IF_ERROR(JudgeModels(Evidence(), options_));
  if (!mapped.agreement.IsPlausible()) {
    run_.warn(DescribeDisagreement(Evidence(), mapped.agreement.agreeing,
                                   mapped.agreement.disagreeing,
                                   IndicesOf(mapped.agreement.doubtful)));
  }
  return absl::OkStatus();
}

// Returns the indices of photographs by their names in COLMAP.
std::vector<size_t> PoseEstimation::IndicesOf(const Words& names) const {
  std::map<std::string_view, size_t> index;
  for (size_t i = 0; i < safe_names_.size(); ++i) index[safe_names_[i]] = i;
  std::vector<size_t> found;
  for (const std::string& name : names) {
    if (const auto at = index.find(name); at != index.end()) found.push_back(at->second);
  }
  return found;
}

// Collects what is known so far, with the owner's names in place of COLMAP's.
SfmEvidence PoseEstimation::Evidence() const {
  SfmEvidence evidence;
  for (size_t i = 0; i < photographs_.size(); ++i) {
    evidence.names.push_back(photographs_[i].name);
    const auto features = progress_.num_features().find(safe_names_[i]);
    // A photograph that COLMAP could not read has no entry.
    evidence.num_features.push_back(features == progress_.num_features().end() ? 0
                                                                               : features->second);
  }
  evidence.num_connected = progress_.num_connected();
  // Models hold COLMAP's names, the verdict speaks of photographs by index.
  for (const SfmModel& model : models_) evidence.models.push_back(IndicesOf(model.names));
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
                                             const SfmRun& run) {
  RETURN_IF_ERROR(Validate(options));
  RETURN_IF_ERROR(CheckEnough(photographs));
  PoseEstimation estimation(photographs, places, options, run);
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
