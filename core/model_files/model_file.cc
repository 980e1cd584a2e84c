#include "core/model_files/model_file.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/byte_reader.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/formats/gaussian_ply.h"
#include "core/model_files/manifest.h"
#include "core/model_files/model_facts.h"
#include "kernels/half.h"

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

// The file of features.
constexpr absl::string_view kFeatureMagic = "PPSGFEAT";
constexpr uint32_t kOneLayerVersion = 1, kTwoLayerVersion = 2;  // by the layers of the gate
// Numbers of a gate of one and of two layers.
constexpr size_t kGateNumbers = 64, kTwoLayerGateNumbers = 1120;
// Limits of counts that a file may declare.
constexpr uint64_t kMaxGaussians = 50'000'000;
constexpr uint32_t kMaxQuantiles = 1'000'000;
constexpr int64_t kMaxFeatureBytes = int64_t{4} << 30;

// Returns the bytes of an array as they are in memory. Files are little-endian, and so are the
// machines that the program runs on.
template <class T>
std::string_view BytesOf(const T& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0])};
}

bool AllFinite(std::span<const float> values) {
  return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
}

// Checks that there is one confidence for each Gaussian, or none at all.
absl::Status CheckConfidence(const FeatureField& field, absl::string_view name) {
  const size_t count = field.features.size() / kFeatureDim;
  if (field.confidence.size() != count && !field.confidence.empty()) {
    return Refused(name,
                   absl::StrCat(field.confidence.size(), " confidences of ", count, " Gaussians"));
  }
  const auto bad = std::find_if(field.confidence.begin(), field.confidence.end(),
                                [](float c) { return !(c > 0 && c <= 1); });
  if (bad == field.confidence.end()) return absl::OkStatus();
  return Refused(name, absl::StrCat("the confidence of Gaussian ", bad - field.confidence.begin(),
                                    " is ", *bad, ", must be in (0, 1]"));
}

// Checks the values of a field, before writing and after reading.
absl::Status CheckField(const FeatureField& field, absl::string_view name) {
  if (field.features.size() % kFeatureDim != 0) return Refused(name, "features are not whole rows");
  RETURN_IF_ERROR(CheckConfidence(field, name));
  if (field.gate.size() != kGateNumbers && field.gate.size() != kTwoLayerGateNumbers) {
    return Refused(name, absl::StrCat("the gate has ", field.gate.size(), " numbers, must be ",
                                      kGateNumbers, " or ", kTwoLayerGateNumbers));
  }
  if (!AllFinite(field.gate)) return Refused(name, "the gate is not finite");
  if (!AllFinite(field.scale_quantiles)) return Refused(name, "a scale quantile is not finite");
  if (!std::is_sorted(field.scale_quantiles.begin(), field.scale_quantiles.end())) {
    return Refused(name, "the scale quantiles descend");
  }
  const auto bad = std::find_if(field.features.begin(), field.features.end(),
                                [](float v) { return !std::isfinite(v); });
  if (bad == field.features.end()) return absl::OkStatus();
  return Refused(
      name, absl::StrCat("the feature of Gaussian ", (bad - field.features.begin()) / kFeatureDim,
                         " is not finite"));
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

absl::StatusOr<std::vector<ModelView>> ReadModelViews(const std::filesystem::path& folder) {
  ASSIGN_OR_RETURN(const std::string text, ReadListedFile(folder, kFactsName, kMaxFactsBytes));
  Model model;
  RETURN_IF_ERROR(ParseModelFacts(text, model));
  return std::move(model.views);
}

std::string FormatView(const ModelView& view) {
  Model one;
  one.views = {view};
  return FormatModelFacts(one);
}

absl::StatusOr<ModelView> ParseView(absl::string_view text) {
  Model one;
  RETURN_IF_ERROR(ParseModelFacts(text, one));
  if (one.views.size() == 1) return std::move(one.views[0]);
  return absl::DataLossError("the text has not one view");
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

absl::StatusOr<std::string> FormatFeatureField(const FeatureField& field, const std::string& name) {
  RETURN_IF_ERROR(CheckField(field, name));
  // The header as arrays, so that BytesOf can write them. Their sizes need no padding.
  const bool two_layers = field.gate.size() == kTwoLayerGateNumbers;
  const std::vector<uint32_t> head = {two_layers ? kTwoLayerVersion : kOneLayerVersion,
                                      kFeatureDim};
  const std::vector<uint64_t> count = {field.features.size() / kFeatureDim};
  const std::vector<uint32_t> tail = {static_cast<uint32_t>(field.scale_quantiles.size()),
                                      field.confidence.empty() ? 0u : 1u};
  std::vector<uint16_t> halves;
  halves.reserve(field.features.size() + field.confidence.size());
  // Features have length 1 or 0, far within the range of half precision.
  for (const float value : field.features) halves.push_back(HalfFromFloat(value).bits);
  for (const float value : field.confidence) halves.push_back(HalfFromFloat(value).bits);
  std::string bytes(kFeatureMagic);
  for (const std::string_view part :
       {BytesOf(head), BytesOf(count), BytesOf(tail), BytesOf(field.gate),
        BytesOf(field.scale_quantiles), BytesOf(halves)}) {
    bytes.append(part);
  }
  return bytes;
}

absl::Status WriteFeatureFile(const std::filesystem::path& path, const FeatureField& field) {
  ASSIGN_OR_RETURN(const std::string bytes, FormatFeatureField(field, path.string()));
  return WriteFileAtomically(path, bytes);
}

absl::StatusOr<FeatureField> ReadFeatureFile(const std::filesystem::path& path,
                                             const std::string& name) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, name, kMaxFeatureBytes));
  return ParseFeatureField(bytes, name);
}

absl::StatusOr<FeatureField> ParseFeatureField(std::string_view bytes, const std::string& name) {
  if (!bytes.starts_with(std::string_view(kFeatureMagic.data(), kFeatureMagic.size()))) {
    return Refused(name, "is not a feature file");
  }
  ByteReader reader(absl::string_view(bytes.data(), bytes.size()));
  reader.Skip(kFeatureMagic.size());
  const auto version = reader.Take<uint32_t>();
  const auto dim = reader.Take<uint32_t>();
  const auto count = reader.Take<uint64_t>();
  const auto num_quantiles = reader.Take<uint32_t>();
  const auto with_confidence = reader.Take<uint32_t>();
  if (!reader.ok()) return Refused(name, "is cut short");
  if ((version != kOneLayerVersion && version != kTwoLayerVersion) || dim != kFeatureDim) {
    return Refused(name,
                   absl::StrCat("has version ", version, " and ", dim, " dimensions; versions ",
                                kOneLayerVersion, " and ", kTwoLayerVersion, " and ", kFeatureDim,
                                " dimensions are read"));
  }
  FeatureField field;
  field.gate.resize(version == kTwoLayerVersion ? kTwoLayerGateNumbers : kGateNumbers);
  if (with_confidence > 1) {
    return Refused(name, absl::StrCat("has ", with_confidence,
                                      " where 1 stands for confidences and 0 for none"));
  }
  // Compares the counts with the size of the file before anything is allocated for them. The limits
  // keep the sum from overflowing.
  if (count > kMaxGaussians || num_quantiles > kMaxQuantiles ||
      reader.remaining() != field.gate.size() * sizeof(float) + num_quantiles * sizeof(float) +
                                count * (kFeatureDim + with_confidence) * sizeof(uint16_t)) {
    return Refused(name,
                   absl::StrCat("declares ", count, " Gaussians and ", num_quantiles,
                                " quantiles, which ", reader.remaining(), " bytes do not hold"));
  }
  reader.TakeAll(std::span<float>(field.gate));
  field.scale_quantiles.resize(num_quantiles);
  reader.TakeAll(std::span<float>(field.scale_quantiles));
  field.features.resize(count * kFeatureDim);
  for (float& value : field.features) value = FloatFromHalf(reader.Take<Half>());
  field.confidence.resize(count * with_confidence);
  for (float& value : field.confidence) value = FloatFromHalf(reader.Take<Half>());
  RETURN_IF_ERROR(CheckField(field, name));
  return field;
}

}  // namespace pepeseg
