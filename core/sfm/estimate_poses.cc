#include "core/sfm/estimate_poses.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/model_files/manifest.h"
#include "core/sfm/colmap_program.h"
#include "core/sfm/find_features.h"
#include "core/sfm/incremental_mapping.h"
#include "core/sfm/match_features.h"
#include "core/sfm/own_mapping.h"
#include "core/sfm/pair_evidence.h"
#include "core/sfm/sfm_model.h"
#include "core/sfm/sfm_verdict.h"
#include "core/sfm/sfm_watch.h"

namespace pepeseg {
namespace {

// Maximum number of photographs of which all pairs are compared (about 20,000 pairs).
constexpr size_t kMostExhaustive = 200;
constexpr char kProgramFile[] = "program.txt";
constexpr char kOwnMapper[] = "pepeseg";

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

// One run of the stage. EstimatePoses calls the public methods in their order.
class PoseEstimation {
 public:
  PoseEstimation(std::span<const SfmPhotograph> photographs, const SfmPlaces& places,
                 const SfmOptions& options, const SfmRun& run)
      : photographs_(photographs),
        places_(places),
        options_(options),
        run_(run),
        safe_names_(SafeNames(photographs)),
        load_(LoadOf(photographs, options, !run.backend.memory().is_host)),
        watch_(load_, options, run.progress) {}

  absl::Status OpenProgram();
  absl::Status LayOutPhotographs();
  absl::Status FindFeatures();
  absl::Status MatchFeatures();
  absl::Status Map();
  absl::Status KeepLargestModel();

 private:
  std::vector<SfmPhotograph> PhotographsInDatabase() const;
  absl::StatusOr<bool> MapByOwn();
  absl::Status MapByColmap();
  SfmEvidence Evidence() const;
  std::vector<size_t> IndicesOf(const Words& names) const;
  std::filesystem::path Database() const { return places_.work / "database.db"; }
  std::filesystem::path OwnDatabase() const { return places_.work / "own.db"; }
  std::filesystem::path Images() const { return places_.work / "images"; }
  std::filesystem::path Models() const { return places_.work / "models"; }

  std::span<const SfmPhotograph> photographs_;
  const SfmPlaces& places_;
  const SfmOptions& options_;
  const SfmRun& run_;
  std::vector<std::string> safe_names_;  // names of the photographs in COLMAP, see SafeNames
  SfmLoad load_;
  SfmWatch watch_;
  std::optional<ColmapProgram> program_;
  bool any_mask_ = false;
  std::optional<ComparedDatabase> compared_;  // if the own front has written OwnDatabase()
  std::vector<SfmModel> models_;
  ModelAgreement agreement_;  // of the first model
  std::string mapper_;        // who made them
};

absl::Status PoseEstimation::OpenProgram() {
  ASSIGN_OR_RETURN(program_, ColmapProgram::Open(places_.program, places_.log));
  return absl::OkStatus();
}

absl::Status PoseEstimation::LayOutPhotographs() {
  ASSIGN_OR_RETURN(any_mask_, LayOut(photographs_, Images(), places_.work / "masks"));
  return absl::OkStatus();
}

absl::Status PoseEstimation::FindFeatures() {
  const FeatureTask task{photographs_,
                         safe_names_,
                         Images(),
                         any_mask_ ? places_.work / "masks" : std::filesystem::path(),
                         places_.work / "sensors",
                         Database(),
                         options_.max_features,
                         places_.num_threads};
  absl::Status status = options_.features == SfmEngine::kColmap
                            ? FindFeaturesByColmap(task, *program_, watch_)
                            : FindOwnFeatures(task, run_.backend, *program_, watch_);
  // An INVALID_ARGUMENT is about a photograph, which COLMAP could not use either.
  if (!status.ok() && !watch_.stopped() && options_.features == SfmEngine::kAuto &&
      !absl::IsInvalidArgument(status)) {
    run_.warn(
        absl::StrCat("COLMAP finds the features of the photographs, which takes longer, because "
                     "pepeseg failed to: ",
                     status.message()));
    std::error_code ignored;  // COLMAP would add to what is there
    std::filesystem::remove(task.database, ignored);
    status = FindFeaturesByColmap(task, *program_, watch_);
  }
  RETURN_IF_ERROR(status);
  return JudgeFeatures(Evidence(), options_);
}

absl::Status PoseEstimation::MatchFeatures() {
  const MatchingTask task{Database(), OwnDatabase(), load_, places_.num_threads};
  if (options_.front != SfmEngine::kColmap) {
    absl::StatusOr<ComparedDatabase> compared =
        MatchByOwnFront(task, options_, run_.backend, watch_);
    if (compared.ok()) {
      compared_ = *std::move(compared);
      return absl::OkStatus();
    }
    if (watch_.stopped() || options_.front == SfmEngine::kOwn) return compared.status();
    run_.warn(
        absl::StrCat("COLMAP matches the photographs, which takes longer, because pepeseg's "
                     "matcher failed: ",
                     compared.status().message()));
  }
  return MatchByColmap(task, options_, *program_, watch_);
}

absl::Status PoseEstimation::Map() {
  RETURN_IF_ERROR(MakeEmptyFolder(Models()));
  ASSIGN_OR_RETURN(const bool is_mapped, MapByOwn());
  if (!is_mapped) RETURN_IF_ERROR(MapByColmap());
  const SfmEvidence evidence = Evidence();
  RETURN_IF_ERROR(JudgeModels(evidence, options_));
  if (const std::string unplaced = DescribeUnplaced(evidence); !unplaced.empty()) {
    run_.warn(unplaced);
  }
  if (evidence.turns_on_the_spot) run_.warn(DescribeTurn(evidence));
  if (!agreement_.IsPlausible()) {
    run_.warn(DescribeDisagreement(evidence, agreement_.agreeing, agreement_.disagreeing,
                                   IndicesOf(agreement_.doubtful)));
  }
  return absl::OkStatus();
}

// Returns the photographs as their copies, in the order of the database: by their names in COLMAP.
std::vector<SfmPhotograph> PoseEstimation::PhotographsInDatabase() const {
  Words names;
  for (const DatabaseImage& image : compared_->features.images) names.push_back(image.name);
  std::vector<SfmPhotograph> photographs;
  for (const size_t i : IndicesOf(names)) {
    photographs.push_back(photographs_[i]);
    photographs.back().path = Images() / safe_names_[i];
  }
  return photographs;
}

// Returns whether there is a model that may be used. Pairs that COLMAP compared are in its database
// only, so that its mapper is the one for them.
absl::StatusOr<bool> PoseEstimation::MapByOwn() {
  if (options_.mapper == SfmEngine::kColmap) return false;
  if (options_.mapper == SfmEngine::kAuto &&
      static_cast<int64_t>(photographs_.size()) < kFewestForOwnMapper) {
    return false;
  }
  std::string refusal = "COLMAP matched the photographs";
  if (compared_) {
    const std::vector<SfmPhotograph> in_order = PhotographsInDatabase();
    const OwnMappingInput input{in_order, *compared_, Models() / "own", places_.num_threads};
    absl::StatusOr<OwnMapping> mapping = MapByOwnMapper(input, [this](double share) {
      watch_.progress().Place(share);
      return watch_.ReportInTime("at placing photographs");
    });
    if (!mapping.ok() && watch_.stopped()) return mapping.status();
    refusal = mapping.ok() ? mapping->refusal : std::string(mapping.status().message());
    if (refusal.empty()) {
      models_ = std::move(mapping->mapped.models);
      agreement_ = std::move(mapping->mapped.agreement);
      mapper_ = kOwnMapper;
      return true;
    }
  }
  if (options_.mapper == SfmEngine::kOwn) {
    return absl::FailedPreconditionError(absl::StrCat("pepeseg found no poses: ", refusal,
                                                      "; leave sfm.mapper unset, so that "
                                                      "COLMAP is tried as well, or upload poses"));
  }
  if (compared_) {
    run_.warn(absl::StrCat(
        "COLMAP places the photographs, which takes longer, because pepeseg does not: ", refusal));
  }
  return false;
}

absl::Status PoseEstimation::MapByColmap() {
  const MappingInput input{compared_ ? OwnDatabase() : Database(), Images(), Models(),
                           ColmapThreads(places_.num_threads), compared_ ? &*compared_ : nullptr};
  ASSIGN_OR_RETURN(MappedModels mapped, MapIncrementally(input, [this](const auto& command) {
                     return watch_.Run(*program_, command);
                   }));
  models_ = std::move(mapped.models);
  agreement_ = std::move(mapped.agreement);
  mapper_ = program_->version();
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
  const std::map<std::string, int64_t>& num_features = watch_.progress().num_features();
  for (size_t i = 0; i < photographs_.size(); ++i) {
    evidence.names.push_back(photographs_[i].name);
    const auto features = num_features.find(safe_names_[i]);
    // A photograph that COLMAP could not read has no entry.
    evidence.num_features.push_back(features == num_features.end() ? 0 : features->second);
  }
  evidence.num_connected = watch_.progress().num_connected();
  if (compared_) {
    const PairEvidence pairs = JudgePairs(*compared_);
    const std::vector<size_t> indices = IndicesOf(pairs.names);
    evidence.num_partners.resize(photographs_.size());
    for (size_t i = 0; i < indices.size(); ++i) {
      evidence.num_partners[indices[i]] = pairs.num_partners[i];
    }
    evidence.turns_on_the_spot = pairs.turns_on_the_spot;
  }
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
  RETURN_IF_ERROR(WriteFileAtomically(places_.result / kProgramFile, mapper_ + "\n"));
  const Words files = {"cameras.bin", "images.bin", "points3D.bin", kProgramFile};
  ASSIGN_OR_RETURN(const Manifest manifest, BuildManifest(places_.result, files));
  RETURN_IF_ERROR(WriteManifest(places_.result, manifest));
  watch_.progress().Finish();
  return watch_.Report();
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
  RETURN_IF_ERROR(estimation.FindFeatures());
  RETURN_IF_ERROR(estimation.MatchFeatures());
  RETURN_IF_ERROR(estimation.Map());
  RETURN_IF_ERROR(estimation.KeepLargestModel());
  return ReadEstimatedPoses(places.result);
}

int64_t SfmHostBytes(int64_t max_pixels, int num_threads, const SfmOptions& options) {
  return FeatureHostBytes(max_pixels, num_threads, options.features == SfmEngine::kColmap);
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
