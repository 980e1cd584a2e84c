#include <cstdint>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "core/base/byte_reader.h"
#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/model_files/model_file.h"

namespace pepeseg {
namespace {

constexpr std::string_view kMagic = "PPSGSELE";
constexpr uint32_t kVersion = 1;
constexpr uint64_t kMaxGaussians = 50'000'000;
constexpr int64_t kMaxFileBytes = int64_t{8} << 20;  // enough for kMaxGaussians
constexpr size_t kDigestBytes = 64;

absl::Status DataLoss(absl::string_view name, absl::string_view why) {
  return absl::DataLossError(absl::StrCat(name, ": ", why));
}

// Appends the bytes of a number as they are in memory, little-endian.
template <class T>
void Append(T value, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

// Returns how many bytes hold `num_bits` bits.
size_t NumBytes(uint64_t num_bits) { return static_cast<size_t>((num_bits + 7) / 8); }

// Parses the bytes that the digest covers. The caller has checked magic number and digest.
absl::StatusOr<GaussianSet> ParseBody(absl::string_view body, const std::string& name) {
  ByteReader reader(body);
  reader.Skip(kMagic.size());
  const auto version = reader.Take<uint32_t>();
  reader.Take<uint32_t>();  // reserved, 0
  const auto count = reader.Take<uint64_t>();
  if (version != kVersion) {
    return DataLoss(name,
                    absl::StrCat("has version ", version, "; version ", kVersion, " is read"));
  }
  // Before anything is allocated for the count.
  if (!reader.ok() || count > kMaxGaussians || reader.remaining() != NumBytes(count)) {
    return DataLoss(name, absl::StrCat("declares ", count, " Gaussians, which ", reader.remaining(),
                                       " bytes do not hold"));
  }
  const absl::string_view bits = body.substr(reader.offset());
  GaussianSet set;
  set.member.reserve(count);
  for (uint64_t i = 0; i < count; ++i) {
    set.member.push_back(static_cast<uint8_t>(bits[i / 8] >> (i % 8) & 1));
  }
  return set;
}

}  // namespace

absl::Status WriteSelectionFile(const std::filesystem::path& path, const GaussianSet& set) {
  // Magic, version, reserved, count, a bit for each Gaussian (lowest first), SHA-256 in
  // hexadecimal.
  std::string bytes(kMagic);
  Append(kVersion, bytes);
  Append(uint32_t{0}, bytes);
  Append(uint64_t{set.member.size()}, bytes);
  std::string bits(NumBytes(set.member.size()), '\0');
  for (size_t i = 0; i < set.member.size(); ++i) {
    if (set.member[i] != 0) bits[i / 8] = static_cast<char>(bits[i / 8] | 1 << (i % 8));
  }
  bytes += bits;
  bytes += Sha256Hex(bytes);
  return WriteFileAtomically(path, bytes);
}

absl::StatusOr<GaussianSet> ReadSelectionFile(const std::filesystem::path& path,
                                              const std::string& name) {
  const auto bytes = ReadFile(path, name, kMaxFileBytes);
  // A selection that the database lists must be there: a missing file is damage, too.
  if (!bytes.ok()) return absl::DataLossError(bytes.status().message());
  if (bytes->size() < kMagic.size() + kDigestBytes || !bytes->starts_with(kMagic)) {
    return DataLoss(name, "is not a selection");
  }
  const absl::string_view body(bytes->data(), bytes->size() - kDigestBytes);
  if (Sha256Hex({body.data(), body.size()}) != bytes->substr(body.size())) {
    return DataLoss(name, "fails its checksum");
  }
  return ParseBody(body, name);
}

}  // namespace pepeseg
