#include "core/formats/zip_writer.h"

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <new>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

// APPNOTE.TXT of PKWARE, sections 4.3 and 4.4.
namespace pepeseg {
namespace {

constexpr uint16_t kVersion = 20;       // that can unpack deflated files in folders
constexpr uint16_t kVersionZip64 = 45;  // that can unpack more than 65,534 files
constexpr uint16_t kUtf8Names = 1 << 11;
constexpr uint16_t kDate = 1 << 5 | 1;  // 1 January 1980, the first that a zip can name
constexpr int64_t kMaxBytes = std::numeric_limits<uint32_t>::max();
constexpr int64_t kMaxFiles = std::numeric_limits<uint16_t>::max() - 1;

// Appends the lowest `num_bytes` bytes of a number, the lowest first.
void Append(uint64_t number, int num_bytes, std::string& out) {
  for (int i = 0; i < num_bytes; ++i) out.push_back(static_cast<char>(number >> (8 * i)));
}

// Returns the bytes as one deflate stream.
std::string Deflated(absl::string_view bytes) {
  z_stream stream = {};
  constexpr int kRaw = -MAX_WBITS, kMemory = 9;
  // The parameters are valid: the calls fail without memory only, which new reports.
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, kRaw, kMemory, Z_DEFAULT_STRATEGY) !=
      Z_OK) {
    throw std::bad_alloc();
  }
  std::string out(deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

absl::Status CheckSize(int64_t num_bytes) {
  if (num_bytes <= kMaxBytes) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat("a zip of more than ", kMaxBytes, " bytes"));
}

}  // namespace

absl::Status ZipWriter::Add(absl::string_view name, absl::string_view bytes, Method method) {
  RETURN_IF_ERROR(CheckSize(static_cast<int64_t>(bytes.size())));
  const std::string deflated = method == Method::kDeflated ? Deflated(bytes) : std::string();
  // Deflate makes short files longer.
  const bool is_deflated = method == Method::kDeflated && deflated.size() < bytes.size();
  const absl::string_view stored = is_deflated ? absl::string_view(deflated) : bytes;
  constexpr int64_t kRecords = 200;  // bytes, more than those of a file without its names
  RETURN_IF_ERROR(
      CheckSize(num_bytes() + static_cast<int64_t>(stored.size() + 2 * name.size()) + kRecords));
  // What the record before the file and that in the directory have in common.
  std::string common;
  Append(kVersion, 2, common);
  Append(kUtf8Names, 2, common);
  Append(is_deflated ? Z_DEFLATED : 0, 2, common);
  Append(0, 2, common);  // midnight
  Append(kDate, 2, common);
  Append(crc32(crc32(0, nullptr, 0), reinterpret_cast<const Bytef*>(bytes.data()),
               static_cast<uInt>(bytes.size())),
         4, common);
  Append(stored.size(), 4, common);
  Append(bytes.size(), 4, common);
  Append(name.size(), 2, common);
  Append(0, 2, common);  // no extra fields

  directory_ += "PK\1\2";
  Append(kVersion, 2, directory_);  // made by MS-DOS, whose attributes say nothing here
  directory_ += common;
  directory_.append(2 + 2 + 2 + 4, '\0');  // no comment, one disk, no attributes
  Append(zip_.size(), 4, directory_);
  absl::StrAppend(&directory_, name);

  absl::StrAppend(&zip_, "PK\3\4", common, name, stored);
  ++num_files_;
  return absl::OkStatus();
}

absl::StatusOr<std::string> ZipWriter::Finish() && {
  constexpr int64_t kEnd = 98;  // bytes
  RETURN_IF_ERROR(CheckSize(num_bytes() + kEnd));
  const uint64_t start = zip_.size();
  const uint64_t size = directory_.size();
  zip_ += directory_;
  if (num_files_ > kMaxFiles) {
    const uint64_t end = zip_.size();
    zip_ += "PK\6\6";
    Append(44, 8, zip_);  // the bytes of this record that follow
    Append(kVersionZip64, 2, zip_);
    Append(kVersionZip64, 2, zip_);
    Append(0, 8, zip_);  // this is disk 0, as is that of the directory
    Append(static_cast<uint64_t>(num_files_), 8, zip_);
    Append(static_cast<uint64_t>(num_files_), 8, zip_);
    Append(size, 8, zip_);
    Append(start, 8, zip_);
    zip_ += "PK\6\7";
    Append(0, 4, zip_);  // the disk of the record above
    Append(end, 8, zip_);
    Append(1, 4, zip_);  // of one disk
  }
  const auto count = static_cast<uint64_t>(std::min(num_files_, kMaxFiles + 1));
  zip_ += "PK\5\6";
  Append(0, 4, zip_);  // disks
  Append(count, 2, zip_);
  Append(count, 2, zip_);
  Append(size, 4, zip_);
  Append(start, 4, zip_);
  Append(0, 2, zip_);  // no comment
  return std::move(zip_);
}

}  // namespace pepeseg
