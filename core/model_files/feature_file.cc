#include "core/model_files/feature_file.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/atomic_file.h"
#include "core/base/byte_reader.h"
#include "core/base/file_bytes.h"
#include "core/base/private_error.h"
#include "core/base/status_macros.h"
#include "kernels/half.h"

namespace pepeseg {
namespace {

constexpr absl::string_view kMagic = "PPSGFEAT";
constexpr uint32_t kVersion = 1, kTwoLayerVersion = 2;  // by the layers of the gate
// Numbers of a gate of one and of two layers.
constexpr size_t kGateNumbers = 64, kTwoLayerGateNumbers = 1120;
// Limits of counts that a file may declare.
constexpr uint64_t kMaxGaussians = 50'000'000;
constexpr uint32_t kMaxQuantiles = 1'000'000;
constexpr int64_t kMaxFileBytes = int64_t{4} << 30;

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

absl::Status WriteFeatureFile(const std::filesystem::path& path, const FeatureField& field) {
  RETURN_IF_ERROR(CheckField(field, path.string()));
  // The header as arrays, so that BytesOf can write them. Their sizes need no padding.
  const bool two_layers = field.gate.size() == kTwoLayerGateNumbers;
  const std::vector<uint32_t> head = {two_layers ? kTwoLayerVersion : kVersion, kFeatureDim};
  const std::vector<uint64_t> count = {field.features.size() / kFeatureDim};
  const std::vector<uint32_t> tail = {static_cast<uint32_t>(field.scale_quantiles.size()),
                                      field.confidence.empty() ? 0u : 1u};
  std::vector<uint16_t> halves;
  halves.reserve(field.features.size() + field.confidence.size());
  // Features have length 1 or 0, far within the range of half precision.
  for (const float value : field.features) halves.push_back(HalfFromFloat(value).bits);
  for (const float value : field.confidence) halves.push_back(HalfFromFloat(value).bits);
  ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  RETURN_IF_ERROR(file.Append(std::string_view(kMagic.data(), kMagic.size())));
  for (const std::string_view part :
       {BytesOf(head), BytesOf(count), BytesOf(tail), BytesOf(field.gate),
        BytesOf(field.scale_quantiles), BytesOf(halves)}) {
    RETURN_IF_ERROR(file.Append(part));
  }
  return file.Commit();
}

absl::StatusOr<FeatureField> ReadFeatureFile(const std::filesystem::path& path,
                                             const std::string& name) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, name, kMaxFileBytes));
  if (bytes.compare(0, kMagic.size(), kMagic.data(), kMagic.size()) != 0) {
    return Refused(name, "is not a feature file");
  }
  ByteReader reader(bytes);
  reader.Skip(kMagic.size());
  const auto version = reader.Take<uint32_t>();
  const auto dim = reader.Take<uint32_t>();
  const auto count = reader.Take<uint64_t>();
  const auto num_quantiles = reader.Take<uint32_t>();
  const auto with_confidence = reader.Take<uint32_t>();
  if (!reader.ok()) return Refused(name, "is cut short");
  if ((version != kVersion && version != kTwoLayerVersion) || dim != kFeatureDim) {
    return Refused(name, absl::StrCat("has version ", version, " and ", dim,
                                      " dimensions; versions ", kVersion, " and ", kTwoLayerVersion,
                                      " and ", kFeatureDim, " dimensions are read"));
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
