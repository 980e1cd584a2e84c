#include "server/jobs/event_log.h"

#include <fcntl.h>
#include <google/protobuf/util/time_util.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <string>

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

}  // namespace

absl::StatusOr<std::unique_ptr<EventLogWriter>> EventLogWriter::Open(
    const std::filesystem::path& path) {
  EventLogReader reader(path);
  int64_t last_sequence = 0;
  while (true) {
    const absl::StatusOr<std::vector<v1::JobEvent>> events = reader.Read();
    // Behind a broken record nothing can be found: it is cut off like a torn one.
    if (!events.ok() || events->empty()) break;
    last_sequence = events->back().sequence();
  }
  const int descriptor = open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (descriptor < 0) return FileError(path, "open", errno);
  auto writer = std::unique_ptr<EventLogWriter>(new EventLogWriter(path, descriptor));
  writer->last_sequence_ = last_sequence;
  writer->size_ = reader.offset();
  if (ftruncate(descriptor, writer->size_) != 0) return FileError(path, "truncate", errno);
  return writer;
}

EventLogWriter::~EventLogWriter() { close(descriptor_); }

absl::Status EventLogWriter::Append(v1::JobEvent event) {
  event.set_sequence(last_sequence_ + 1);
  if (!event.has_time()) {
    *event.mutable_time() = google::protobuf::util::TimeUtil::GetCurrentTime();
  }
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
  ++last_sequence_;
  return absl::OkStatus();
}

absl::StatusOr<bool> EventLogReader::ReadRecord(std::ifstream& stream, v1::JobEvent* event) {
  std::array<char, sizeof(RecordHeader)> bytes{};
  if (!stream.read(bytes.data(), bytes.size())) return false;
  RecordHeader header;
  std::memcpy(&header, bytes.data(), sizeof(header));
  const auto broken = [&](const std::string& what) {
    return absl::DataLossError(
        absl::StrCat(path_.string(), ": record at byte ", offset_, ": ", what));
  };
  if (header.length > kMaxPayload) return broken(absl::StrCat("length ", header.length));
  std::string payload(header.length, '\0');
  if (!stream.read(payload.data(), header.length)) return false;
  if (Crc32c(payload) != header.crc) return broken("its CRC-32C does not match");
  if (!event->ParseFromString(payload)) return broken("it is no event");
  offset_ += static_cast<int64_t>(sizeof(header)) + header.length;
  return true;
}

absl::StatusOr<std::vector<v1::JobEvent>> EventLogReader::Read(size_t max_events) {
  std::vector<v1::JobEvent> events;
  std::ifstream stream(path_, std::ios::binary);
  stream.seekg(offset_);
  if (!stream) return events;
  while (events.size() < max_events) {
    v1::JobEvent event;
    const absl::StatusOr<bool> whole = ReadRecord(stream, &event);
    if (!whole.ok() && events.empty()) return whole.status();
    if (!whole.ok() || !*whole) break;
    if (event.sequence() > after_sequence_) events.push_back(std::move(event));
  }
  return events;
}

}  // namespace pepeseg
