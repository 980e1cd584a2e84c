#include "clients/terminal/zip_files.h"

#include <libdeflate.h>

#include <cstdint>
#include <filesystem>
#include <memory>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "clients/cpp/status_macros.h"

// APPNOTE.TXT of PKWARE, sections 4.3 and 4.4.
namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxFileBytes = uint64_t{1} << 31;

absl::Status Malformed(absl::string_view what) {
  return absl::DataLossError(absl::StrCat("the zip is malformed: ", what));
}

// Returns `size` bytes of the zip from `at` on; empty: it does not have them.
absl::string_view Part(absl::string_view zip, uint64_t at, uint64_t size) {
  if (at > zip.size() || size > zip.size() - at) return {};
  return zip.substr(at, size);
}

// Returns the number of `size` bytes, the lowest first. The bytes have them.
uint64_t NumberAt(absl::string_view bytes, size_t at, size_t size) {
  uint64_t number = 0;
  for (size_t i = size; i-- > 0;) number = number << 8 | static_cast<uint8_t>(bytes[at + i]);
  return number;
}

struct Directory {
  uint64_t start = 0, num_files = 0;
};

absl::StatusOr<Directory> FindDirectory(absl::string_view zip) {
  constexpr size_t kEnd = 22, kLocator = 20, kEnd64 = 56;
  // A zip of pepeseg has no comment.
  const absl::string_view end = zip.size() < kEnd ? "" : zip.substr(zip.size() - kEnd);
  if (end.substr(0, 4) != "PK\5\6") return Malformed("its end is missing");
  Directory directory{NumberAt(end, 16, 4), NumberAt(end, 10, 2)};
  if (directory.num_files != UINT16_MAX || zip.size() < kEnd + kLocator) return directory;
  const absl::string_view locator = zip.substr(zip.size() - kEnd - kLocator, kLocator);
  if (locator.substr(0, 4) != "PK\6\7") return directory;
  const absl::string_view end64 = Part(zip, NumberAt(locator, 8, 8), kEnd64);
  if (end64.substr(0, 4) != "PK\6\6") return Malformed("the Zip64 record is missing");
  return Directory{NumberAt(end64, 48, 8), NumberAt(end64, 32, 8)};
}

// Returns the bytes of a file, which `entry` of the directory describes.
absl::StatusOr<std::string> FileOf(absl::string_view zip, absl::string_view entry,
                                   libdeflate_decompressor* decompressor) {
  constexpr size_t kLocal = 30;
  const uint64_t method = NumberAt(entry, 10, 2), checksum = NumberAt(entry, 16, 4);
  const uint64_t packed_size = NumberAt(entry, 20, 4), size = NumberAt(entry, 24, 4);
  const uint64_t at = NumberAt(entry, 42, 4);
  const absl::string_view local = Part(zip, at, kLocal);
  if (local.substr(0, 4) != "PK\3\4") return Malformed("a file is missing");
  const uint64_t start = at + kLocal + NumberAt(local, 26, 2) + NumberAt(local, 28, 2);
  const absl::string_view packed = Part(zip, start, packed_size);
  if (packed.size() != packed_size || size > kMaxFileBytes) return Malformed("a file is cut short");
  std::string bytes;
  if (method == 0) {
    bytes = std::string(packed);
  } else {
    constexpr int kDeflated = 8;
    bytes.resize(size);
    if (method != kDeflated ||
        libdeflate_deflate_decompress(decompressor, packed.data(), packed.size(), bytes.data(),
                                      bytes.size(), nullptr) != LIBDEFLATE_SUCCESS) {
      return Malformed("a file cannot be unpacked");
    }
  }
  if (bytes.size() != size || libdeflate_crc32(0, bytes.data(), bytes.size()) != checksum) {
    return Malformed("a file fails its checksum");
  }
  return bytes;
}

bool LeadsOut(const std::string& name) {
  const fs::path path = fs::path(name).lexically_normal();
  return path.empty() || path.is_absolute() || *path.begin() == "..";
}

}  // namespace

absl::Status ForEachZipFile(
    absl::string_view zip,
    absl::FunctionRef<absl::Status(const std::string& name, absl::string_view bytes)> use) {
  constexpr size_t kEntry = 46;
  const std::unique_ptr<libdeflate_decompressor, void (*)(libdeflate_decompressor*)> decompressor(
      libdeflate_alloc_decompressor(), libdeflate_free_decompressor);
  if (decompressor == nullptr) return absl::ResourceExhaustedError("memory is short");
  ASSIGN_OR_RETURN(const Directory directory, FindDirectory(zip));
  uint64_t at = directory.start;
  for (uint64_t i = 0; i < directory.num_files; ++i) {
    const absl::string_view entry = Part(zip, at, kEntry);
    if (entry.substr(0, 4) != "PK\1\2") return Malformed("its directory is cut short");
    const uint64_t name_size = NumberAt(entry, 28, 2);
    const std::string name(Part(zip, at + kEntry, name_size));
    if (name.size() != name_size || LeadsOut(name)) {
      return Malformed(absl::StrCat("\"", name, "\" is no name of a file in it"));
    }
    ASSIGN_OR_RETURN(const std::string bytes, FileOf(zip, entry, decompressor.get()));
    RETURN_IF_ERROR(use(name, bytes));
    at += kEntry + name_size + NumberAt(entry, 30, 2) + NumberAt(entry, 32, 2);
  }
  return absl::OkStatus();
}

}  // namespace pepeseg::client::cli
