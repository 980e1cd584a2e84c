#include "server/jobs/event_log.h"

#include <fcntl.h>
#include <google/protobuf/util/time_util.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <istream>
#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "server/jobs/crc32c.h"
#include "server/jobs/file_error.h"

namespace pepeseg {
namespace {

static_assert(std::endian::native == std::endian::little);

struct RecordHeader {
  uint32_t length = 0;
  uint32_t crc = 0;
};
static_assert(sizeof(RecordHeader) == 8);

// No event comes near it: more is a broken length, not a reason to allocate.
constexpr uint32_t kMaxPayload = 1 << 20;
// Nor has a log so many: what comes after it still has a number.
constexpr int64_t kMaxSequence = int64_t{1} << 62;

std::filesystem::path FileOf(const std::filesystem::path& path, int64_t fence) {
  if (fence == 0) return path;
  const std::string name =
      absl::StrCat(path.stem().string(), "-", fence, path.extension().string());
  return path.parent_path() / name;
}

// The attempt in "events-7.log"; 0: another file.
int64_t FenceOf(const std::filesystem::path& path, const std::filesystem::path& file) {
  const std::string stem = file.stem().string();
  const std::string prefix = path.stem().string() + "-";
  int64_t fence = 0;
  if (!stem.starts_with(prefix) || !absl::SimpleAtoi(stem.substr(prefix.size()), &fence)) return 0;
  return fence > 0 && FileOf(path, fence) == file ? fence : 0;
}

absl::Status Unreadable(const std::string& where) {
  return absl::InternalError(absl::StrCat(where, ": cannot be read"));
}

// A stream of `file`; none: it is not there.
absl::StatusOr<std::optional<std::ifstream>> OpenIfThere(const std::filesystem::path& file) {
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (stream.is_open()) return stream;
  if (errno == ENOENT || errno == ENOTDIR) return std::nullopt;
  return FileError(file, "open", errno);
}

// The next record of `stream`, told as `where`. false: it is not there yet; DATA_LOSS: it is
// broken; INTERNAL: nobody knows, the disk does not say.
absl::StatusOr<bool> ReadRecord(std::istream& stream, const std::string& where,
                                v1::JobEvent* event) {
  std::array<char, sizeof(RecordHeader)> bytes{};
  if (!stream.read(bytes.data(), bytes.size())) {
    if (stream.bad()) return Unreadable(where);
    return false;
  }
  RecordHeader header;
  std::memcpy(&header, bytes.data(), sizeof(header));
  const auto broken = [&](const std::string& what) {
    return absl::DataLossError(absl::StrCat(where, ": ", what));
  };
  if (header.length > kMaxPayload) return broken(absl::StrCat("length ", header.length));
  std::string payload(header.length, '\0');
  if (!stream.read(payload.data(), header.length)) {
    if (stream.bad()) return Unreadable(where);
    return false;
  }
  if (Crc32c(payload) != header.crc) return broken("its CRC-32C does not match");
  if (!event->ParseFromString(payload)) return broken("it is no event");
  if (event->sequence() < 0 || event->sequence() > kMaxSequence) {
    return broken(absl::StrCat("sequence ", event->sequence()));
  }
  return true;
}

bool IsFirstRecord(const v1::JobEvent& event) {
  return event.event_case() == v1::JobEvent::EVENT_NOT_SET;
}

// The first record of an attempt's file.
struct FirstRecord {
  int64_t sequence = 0;
  int64_t num_bytes = 0;  // as it stands there: written anew it may have others
};

// None: it has none yet.
absl::StatusOr<std::optional<FirstRecord>> ReadFirstRecord(const std::filesystem::path& file) {
  ASSIGN_OR_RETURN(std::optional<std::ifstream> stream, OpenIfThere(file));
  if (!stream) return std::nullopt;
  v1::JobEvent event;
  const absl::StatusOr<bool> whole = ReadRecord(*stream, file.string(), &event);
  if (!whole.ok() && !absl::IsDataLoss(whole.status())) return whole.status();
  if (!whole.ok() || !*whole || !IsFirstRecord(event)) return std::nullopt;
  return FirstRecord{event.sequence(), static_cast<int64_t>(stream->tellg())};
}

// A reader that has read all that there is of the attempts before `end_fence`.
absl::StatusOr<EventLogReader> ReadToEnd(const std::filesystem::path& path, int64_t end_fence) {
  EventLogReader reader(path, 0, end_fence);
  while (true) {
    const absl::StatusOr<std::vector<v1::JobEvent>> events = reader.Read();
    // Behind a broken record nothing can be found: it is cut off like a torn one. What the disk
    // does not give today it may give tomorrow.
    if (!events.ok() && !absl::IsDataLoss(events.status())) return events.status();
    if (!events.ok() || events->empty()) return reader;
  }
}

}  // namespace

absl::StatusOr<std::unique_ptr<EventLogWriter>> EventLogWriter::Open(
    const std::filesystem::path& path, int64_t fence) {
  const std::filesystem::path file = FileOf(path, fence);
  const int descriptor = open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (descriptor < 0) return FileError(file, "open", errno);
  auto writer = std::unique_ptr<EventLogWriter>(new EventLogWriter(file, descriptor));
  ASSIGN_OR_RETURN(const EventLogReader read, ReadToEnd(path, fence + 1));
  writer->last_sequence_ = read.last_sequence();
  // Of a file without a first record the reader knows nothing.
  writer->size_ = read.fence() == fence ? read.offset() : 0;
  if (ftruncate(descriptor, writer->size_) != 0) return FileError(file, "truncate", errno);
  if (fence > 0 && writer->size_ == 0) {
    v1::JobEvent first;
    first.set_sequence(writer->last_sequence_);
    RETURN_IF_ERROR(writer->Write(first));
  }
  return writer;
}

EventLogWriter::~EventLogWriter() { close(descriptor_); }

absl::Status EventLogWriter::Append(v1::JobEvent event) {
  event.set_sequence(last_sequence_ + 1);
  if (!event.has_time()) {
    *event.mutable_time() = google::protobuf::util::TimeUtil::GetCurrentTime();
  }
  RETURN_IF_ERROR(Write(event));
  ++last_sequence_;
  return absl::OkStatus();
}

absl::Status EventLogWriter::Write(const v1::JobEvent& event) {
  std::string record(sizeof(RecordHeader), '\0');
  const std::string payload = event.SerializeAsString();
  const RecordHeader header = {static_cast<uint32_t>(payload.size()), Crc32c(payload)};
  if (payload.size() > kMaxPayload) {
    return absl::InvalidArgumentError(absl::StrCat("event of ", payload.size(), " bytes"));
  }
  std::memcpy(record.data(), &header, sizeof(header));
  record += payload;
  const ssize_t wrote = write(descriptor_, record.data(), record.size());
  if (wrote != static_cast<ssize_t>(record.size())) {
    absl::Status status = FileError(path_, "append", wrote < 0 ? errno : ENOSPC);
    // Half a record would hide what comes after it.
    if (ftruncate(descriptor_, size_) != 0) return FileError(path_, "truncate", errno);
    return status;
  }
  size_ += wrote;
  return absl::OkStatus();
}

absl::StatusOr<std::optional<EventLogReader::Successor>> EventLogReader::FindSuccessor() const {
  std::optional<Successor> next;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(path_.parent_path(), error), end;
       !error && entry != end; entry.increment(error)) {
    const int64_t fence = FenceOf(path_, entry->path());
    if (fence <= fence_ || fence >= end_fence_ || (next && fence >= next->fence)) continue;
    ASSIGN_OR_RETURN(const std::optional<FirstRecord> first, ReadFirstRecord(entry->path()));
    if (first) next = Successor{fence, first->sequence, first->num_bytes};
  }
  if (error && error != std::errc::no_such_file_or_directory) {
    return FileError(path_.parent_path(), "list", error.value());
  }
  return next;
}

// Up to `last_sequence`, from the file of fence_.
absl::Status EventLogReader::ReadFile(int64_t last_sequence, size_t max_events,
                                      std::vector<v1::JobEvent>& events) {
  const std::filesystem::path file = FileOf(path_, fence_);
  ASSIGN_OR_RETURN(std::optional<std::ifstream> stream, OpenIfThere(file));
  if (!stream) return absl::OkStatus();
  stream->seekg(offset_);
  while (*stream && events.size() < max_events) {
    v1::JobEvent event;
    const std::string where = absl::StrCat(file.string(), ": record at byte ", offset_);
    ASSIGN_OR_RETURN(const bool whole, ReadRecord(*stream, where, &event));
    if (!whole || event.sequence() > last_sequence) break;
    offset_ = static_cast<int64_t>(stream->tellg());
    last_sequence_ = event.sequence();
    if (event.sequence() > after_sequence_) events.push_back(std::move(event));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<v1::JobEvent>> EventLogReader::Read(size_t max_events) {
  std::vector<v1::JobEvent> events;
  while (true) {
    // Looked for first: what an attempt has written by the time another takes over is all of it.
    const absl::StatusOr<std::optional<Successor>> found = FindSuccessor();
    if (!found.ok() && events.empty()) return found.status();
    if (!found.ok()) return events;
    const std::optional<Successor>& next = *found;
    const absl::Status read =
        ReadFile(next ? next->last_sequence : Successor().last_sequence, max_events, events);
    // A later attempt has gone on behind a broken record, not behind one that may yet be read.
    const bool passed = read.ok() || (next && absl::IsDataLoss(read));
    if (!passed && events.empty()) return read;
    if (!passed || !next || events.size() >= max_events) return events;
    fence_ = next->fence;
    offset_ = next->offset;
  }
}

}  // namespace pepeseg
