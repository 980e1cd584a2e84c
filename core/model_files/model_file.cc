#include "core/model_files/model_file.h"

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/atomic_file.h"
#include "core/base/file_bytes.h"
#include "core/base/status_macros.h"
#include "core/formats/gaussian_ply.h"
#include "core/model_files/feature_file.h"
#include "core/model_files/manifest.h"
#include "core/model_files/model_facts.h"

namespace pepeseg {
namespace {

constexpr char kGaussiansName[] = "gaussians.ply";
constexpr char kFeaturesName[] = "features.bin";
constexpr char kFactsName[] = "model.json";
constexpr int64_t kMaxFactsBytes = int64_t{256} << 20;

// Returns INVALID_ARGUMENT unless the model has one feature for each Gaussian, or no features.
absl::Status CheckWhole(const Model& model) {
  const auto expected = static_cast<size_t>(model.gaussians.count) * kFeatureDim;
  if (model.field.empty() || model.field.features.size() == expected) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("a model of ", model.gaussians.count, " Gaussians has ",
                   model.field.features.size() / kFeatureDim, " features"));
}

// Turns an error of a parser into DATA_LOSS: the server wrote the files, so malformed ones are not
// a client's fault (INVALID_ARGUMENT).
absl::Status AsDataLoss(const absl::Status& status, const std::filesystem::path& folder) {
  return absl::DataLossError(absl::StrCat(folder.string(), ": ", status.message()));
}

// Reads the files of a model. The caller has verified their digests.
absl::StatusOr<Model> ReadParts(const std::filesystem::path& folder, bool has_features) {
  Model model;
  ASSIGN_OR_RETURN(const std::string facts,
                   ReadFile(folder / kFactsName, kFactsName, kMaxFactsBytes));
  RETURN_IF_ERROR(ParseModelFacts(facts, model));
  // After the metadata, because the Gaussians become relative to the model's origin.
  ASSIGN_OR_RETURN(model.gaussians,
                   ReadGaussianPly(folder / kGaussiansName, kGaussiansName, model.origin));
  if (has_features) {
    ASSIGN_OR_RETURN(model.field, ReadFeatureFile(folder / kFeaturesName, kFeaturesName));
  }
  RETURN_IF_ERROR(CheckWhole(model));
  return model;
}

}  // namespace

absl::Status WriteModel(const std::filesystem::path& folder, const Model& model) {
  RETURN_IF_ERROR(CheckWhole(model));
  // The files of the manifest, in the order in which it lists them.
  std::vector<std::string> names = {kGaussiansName, kFactsName};
  RETURN_IF_ERROR(WriteGaussianPly(folder / kGaussiansName, model.gaussians, model.origin));
  if (!model.field.empty()) {
    RETURN_IF_ERROR(WriteFeatureFile(folder / kFeaturesName, model.field));
    // After the Gaussians: the list says in which order the files are written.
    names.insert(names.begin() + 1, kFeaturesName);
  }
  RETURN_IF_ERROR(WriteFileAtomically(folder / kFactsName, FormatModelFacts(model)));
  // The manifest comes last: a model without one was not written to its end.
  ASSIGN_OR_RETURN(const Manifest manifest, BuildManifest(folder, names));
  return WriteManifest(folder, manifest);
}

absl::StatusOr<ModelShape> ReadModelShape(const std::filesystem::path& folder) {
  Model facts;
  ModelShape shape;
  // Digests are not compared here: only headers are read, of files that may be gigabytes.
  const auto read = [&]() -> absl::Status {
    ASSIGN_OR_RETURN(const std::string text,
                     ReadFile(folder / kFactsName, kFactsName, kMaxFactsBytes));
    RETURN_IF_ERROR(ParseModelFacts(text, facts));
    ASSIGN_OR_RETURN(const GaussianPlyShape gaussians,
                     ReadGaussianPlyShape(folder / kGaussiansName, kGaussiansName));
    shape = {gaussians.count, gaussians.sh_degree, LargestView(facts.views)};
    return absl::OkStatus();
  };
  if (const absl::Status status = read(); !status.ok()) return AsDataLoss(status, folder);
  return shape;
}

absl::StatusOr<Model> ReadModel(const std::filesystem::path& folder) {
  ASSIGN_OR_RETURN(const Manifest manifest, ReadManifest(folder));
  // Features are optional: a model without them can be rendered, but not segmented.
  for (const char* name : {kGaussiansName, kFactsName}) {
    if (!manifest.Lists(name)) {
      return absl::DataLossError(absl::StrCat(folder.string(), ": its manifest has no ", name));
    }
  }
  RETURN_IF_ERROR(VerifyManifest(folder, manifest));
  absl::StatusOr<Model> model = ReadParts(folder, manifest.Lists(kFeaturesName));
  if (!model.ok()) return AsDataLoss(model.status(), folder);
  return model;
}

}  // namespace pepeseg
