#include "server/store/sqlite_log.h"

#include <array>
#include <cstdint>
#include <fstream>
#include <limits>
#include <string>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// The format: https://www.sqlite.org/fileformat2.html, "The Write-Ahead Log".
constexpr size_t kHeaderBytes = 32;
constexpr size_t kFrameHeaderBytes = 24;
constexpr uint32_t kMagic = 0x377f0682;  // with the lowest bit set: checksums of big-endian words

uint32_t BigEndian(std::string_view bytes, size_t at) {
  const auto byte = [&](size_t i) { return static_cast<uint32_t>(static_cast<uint8_t>(bytes[i])); };
  return byte(at) << 24 | byte(at + 1) << 16 | byte(at + 2) << 8 | byte(at + 3);
}

uint32_t LittleEndian(std::string_view bytes, size_t at) {
  return __builtin_bswap32(BigEndian(bytes, at));
}

// The running checksum of the bytes added so far. It processes two 4-byte words at a time.
class LogChecksum {
 public:
  explicit LogChecksum(bool big_endian) : word_(big_endian ? &BigEndian : &LittleEndian) {}

  void Add(std::string_view bytes) {
    for (size_t i = 0; i + 8 <= bytes.size(); i += 8) {
      first_ += word_(bytes, i) + second_;
      second_ += word_(bytes, i + 4) + first_;
    }
  }
  // Returns whether the checksum is stored at `at`.
  bool IsAt(std::string_view bytes, size_t at) const {
    return BigEndian(bytes, at) == first_ && BigEndian(bytes, at + 4) == second_;
  }

 private:
  uint32_t (*word_)(std::string_view, size_t);
  uint32_t first_ = 0, second_ = 0;
};

// Where the log's checksums stop being valid.
struct Break {
  size_t at = 0;        // byte of the first invalid frame, or the log's size
  int num_commits = 0;  // commit frames of this log from there on
};

Break FindBreak(std::string_view log, size_t page_bytes) {
  const size_t frame_bytes = kFrameHeaderBytes + page_bytes;
  // Without a whole frame nothing was committed.
  if (log.size() < kHeaderBytes + frame_bytes) return {};
  LogChecksum checksum((BigEndian(log, 0) & 1) != 0);
  checksum.Add(log.substr(0, kFrameHeaderBytes));
  bool good = (BigEndian(log, 0) & ~uint32_t{1}) == kMagic && BigEndian(log, 8) == page_bytes &&
              checksum.IsAt(log, kFrameHeaderBytes);
  // SQLite overwrites the log from its start and changes the salts each time, so frames left from
  // before have other salts. If the header is damaged, take the salts of the first frame.
  const std::string_view salts = log.substr(good ? 16 : kHeaderBytes + 8, 8);
  Break found{good ? log.size() : 0, 0};
  for (size_t at = kHeaderBytes; at + frame_bytes <= log.size(); at += frame_bytes) {
    const std::string_view frame = log.substr(at, frame_bytes);
    const bool own = frame.substr(8, 8) == salts;
    if (good) {
      // A frame's checksum covers its page number, its size field and its page, and continues that
      // of the frame before, so a break makes all later frames invalid.
      checksum.Add(frame.substr(0, 8));
      checksum.Add(frame.substr(kFrameHeaderBytes));
      good = own && checksum.IsAt(frame, 16);
      if (!good) found.at = at;
    }
    // The size field is not 0 in the last frame of a commit only.
    if (!good && own && BigEndian(frame, 4) != 0) ++found.num_commits;
  }
  return found;
}

// Returns the database's page size. An empty file, whose pages are all still in the log, has
// SQLite's default.
size_t PageBytesOf(const std::filesystem::path& database) {
  constexpr size_t kDefault = 4096, kAt = 16;
  std::array<char, kAt + 2> start{};
  if (!std::ifstream(database, std::ios::binary).read(start.data(), start.size())) return kDefault;
  const auto high = static_cast<uint8_t>(start[kAt]), low = static_cast<uint8_t>(start[kAt + 1]);
  const size_t stored = size_t{high} << 8 | low;
  return stored == 1 ? size_t{65536} : stored;
}

}  // namespace

// A torn write at a power cut damages at most the frames of the last commit, so a single commit
// after the break proves nothing. With two, the first had been synced before the second began, and
// the damage is of another kind.
absl::Status CheckSqliteLog(const std::filesystem::path& database) {
  constexpr int kLooks = 3;
  const std::string path = absl::StrCat(database.string(), "-wal");
  Break found;
  for (int look = 0; look < kLooks; ++look) {
    const auto log = ReadFile(path, path, std::numeric_limits<int64_t>::max());
    if (absl::IsNotFound(log.status())) return absl::OkStatus();
    RETURN_IF_ERROR(log.status());
    const Break seen = FindBreak(*log, PageBytesOf(database));
    if (seen.num_commits < 2) return absl::OkStatus();
    // A process that is writing the log may make it look broken, but not at the same byte again.
    if (look > 0 && seen.at != found.at) return absl::OkStatus();
    found = seen;
    if (look + 1 < kLooks) absl::SleepFor(absl::Milliseconds(20));
  }
  return absl::DataLossError(
      absl::StrCat(path, " is damaged at byte ", found.at,
                   ", and the commits after it would be lost; to keep only those before it, run"
                   " 'truncate --size=",
                   found.at, " ", path, "'"));
}

}  // namespace pepeseg
