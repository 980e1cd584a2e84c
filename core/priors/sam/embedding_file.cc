#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <span>
#include <string_view>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/byte_reader.h"
#include "core/base/digest.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/priors/sam/sam_embedding.h"

namespace pepeseg {
namespace {

constexpr std::string_view kEmbeddingMagic = "PPSGEMBD";
constexpr uint32_t kEmbeddingVersion = 1;
constexpr size_t kOriginDigits = 64;
constexpr size_t kEmbeddingHeader = 8 + 4 * 4 + 2 * kOriginDigits, kEmbeddingSum = 4;
constexpr uint32_t kMaxEmbeddedSide = 1 << 16;  // pixels

std::span<const uint8_t> AsBytes(const void* data, size_t size) {
  return {static_cast<const uint8_t*>(data), size};
}

void AppendWord(uint32_t value, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

// Returns the digest in 64 characters; zeros where it is not one.
std::string OriginDigest(const std::string& digest) {
  return digest.size() == kOriginDigits ? digest : std::string(kOriginDigits, '0');
}

absl::Status DamagedEmbedding(const std::filesystem::path& path, absl::string_view why) {
  return absl::DataLossError(absl::StrCat(path.string(), ": ", why));
}

bool IsFiniteHalf(Half half) { return (half.bits & 0x7c00U) != 0x7c00U; }

}  // namespace

std::string EmbeddingFileName(absl::string_view photograph) {
  const std::string digest = Sha256Hex({photograph.data(), photograph.size()});
  return absl::StrCat("embedding-", digest.substr(0, 32), ".bin");
}

absl::Status WriteEmbedding(const std::filesystem::path& path, const SamEmbedding& embedding,
                            const EmbeddingOrigin& origin) {
  std::string header(kEmbeddingMagic);
  AppendWord(kEmbeddingVersion, header);
  AppendWord(static_cast<uint32_t>(embedding.width), header);
  AppendWord(static_cast<uint32_t>(embedding.height), header);
  AppendWord(static_cast<uint32_t>(embedding.values.size()), header);
  header += OriginDigest(origin.encoder) + OriginDigest(origin.photograph);
  const size_t size = embedding.values.size() * sizeof(Half);
  std::string sum;
  AppendWord(Crc32c(AsBytes(embedding.values.data(), size), Crc32c(header)), sum);

  const std::filesystem::path temporary = path.string() + ".tmp-embedding";
  std::error_code error;
  {
    std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
    file.write(header.data(), static_cast<std::streamsize>(header.size()));
    file.write(reinterpret_cast<const char*>(embedding.values.data()),
               static_cast<std::streamsize>(size));
    file.write(sum.data(), static_cast<std::streamsize>(sum.size()));
    file.close();
    if (!file) error.assign(errno != 0 ? errno : EIO, std::generic_category());
  }
  if (!error) std::filesystem::rename(temporary, path, error);
  if (!error) return absl::OkStatus();
  const int number = error.value();
  std::filesystem::remove(temporary, error);
  return FileError(path, "write", number);
}

absl::StatusOr<SamEmbedding> ReadEmbedding(const std::filesystem::path& path,
                                           const EmbeddingOrigin& origin) {
  const auto bytes = ReadFile(path, path.string(), kEmbeddingFileBytes);
  if (absl::IsNotFound(bytes.status())) return bytes.status();
  if (!bytes.ok()) return DamagedEmbedding(path, bytes.status().message());
  if (bytes->size() < kEmbeddingHeader + kEmbeddingSum) return DamagedEmbedding(path, "is cut off");
  const size_t end = bytes->size() - kEmbeddingSum;
  uint32_t sum = 0;
  std::memcpy(&sum, bytes->data() + end, sizeof(sum));
  if (sum != Crc32c(AsBytes(bytes->data(), end))) {
    return DamagedEmbedding(path, "its checksum differs");
  }
  ByteReader reader(*bytes);
  if (std::string_view(*bytes).substr(0, kEmbeddingMagic.size()) != kEmbeddingMagic) {
    return DamagedEmbedding(path, "is not an embedding");
  }
  reader.Skip(kEmbeddingMagic.size());
  if (reader.Take<uint32_t>() != kEmbeddingVersion) {
    return DamagedEmbedding(path, "has another version");
  }
  const auto width = reader.Take<uint32_t>(), height = reader.Take<uint32_t>();
  const auto count = reader.Take<uint32_t>();
  if (width < 1 || height < 1 || width > kMaxEmbeddedSide || height > kMaxEmbeddedSide ||
      count * sizeof(Half) != end - kEmbeddingHeader) {
    return DamagedEmbedding(path, "its sizes do not fit");
  }
  const std::string encoder = bytes->substr(kEmbeddingHeader - 2 * kOriginDigits, kOriginDigits);
  const std::string photograph = bytes->substr(kEmbeddingHeader - kOriginDigits, kOriginDigits);
  if (encoder != OriginDigest(origin.encoder)) {
    return absl::FailedPreconditionError(absl::StrCat(path.string(), ": is of another SAM"));
  }
  if (!origin.photograph.empty() && photograph != OriginDigest(origin.photograph)) {
    return absl::FailedPreconditionError(absl::StrCat(path.string(), ": is of another photograph"));
  }
  SamEmbedding embedding = {static_cast<int>(width), static_cast<int>(height),
                            std::vector<Half>(count)};
  std::memcpy(embedding.values.data(), bytes->data() + kEmbeddingHeader, count * sizeof(Half));
  if (!std::ranges::all_of(embedding.values, IsFiniteHalf)) {
    return DamagedEmbedding(path, "a value is not finite");
  }
  return embedding;
}

}  // namespace pepeseg
