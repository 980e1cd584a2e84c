#include "server/worker_protocol/event_log.h"

#include <fcntl.h>
#include <google/protobuf/util/time_util.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "server/worker_protocol/client_text.h"

namespace pepeseg {
namespace {

static_assert(std::endian::native == std::endian::little);

struct RecordHeader {
  uint32_t length = 0;
  uint32_t crc = 0;
};
static_assert(sizeof(RecordHeader) == 8);

// Maximum length of a payload, far above any event. A record with a larger one is broken; nothing
// is allocated for it.
constexpr uint32_t kMaxPayload = 1 << 20;
// Maximum sequence number that is accepted, so that the numbers after it do not overflow.
constexpr int64_t kMaxSequence = int64_t{1} << 62;
// Maximum number of events that may be missing (a bad disk lost them) before a worker's file. A
// worker could otherwise use up the numbers.
constexpr int64_t kMaxMissing = int64_t{1} << 32;
// Maximum number of metrics of a stage that are taken from a worker.
constexpr int kMaxWorkerMetrics = 1000;

absl::Status Unreadable(const std::string& where) {
  return absl::InternalError(absl::StrCat(where, ": cannot be read"));
}

// Reads `size` bytes at `offset`. Returns false if the file ends before.
absl::StatusOr<bool> ReadAt(const Descriptor& file, int64_t offset, size_t size, void* bytes,
                            const std::string& where) {
  size_t num_read = 0;
  while (num_read < size) {
    const ssize_t got = pread(file.get(), static_cast<char*>(bytes) + num_read, size - num_read,
                              offset + static_cast<int64_t>(num_read));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return Unreadable(where);
    if (got == 0) return false;
    num_read += static_cast<size_t>(got);
  }
  return true;
}

// Reads the record at `offset`, which errors call `where`, and returns its length in bytes; 0: it
// is not yet written. DATA_LOSS: it is broken. INTERNAL: the disk failed.
absl::StatusOr<int64_t> ReadRecord(const Descriptor& file, int64_t offset, const std::string& where,
                                   v1::JobEvent* event) {
  RecordHeader header;
  ASSIGN_OR_RETURN(bool whole, ReadAt(file, offset, sizeof(header), &header, where));
  if (!whole) return 0;
  const auto broken = [&](const std::string& what) {
    return absl::DataLossError(absl::StrCat(where, ": ", what));
  };
  if (header.length > kMaxPayload) return broken(absl::StrCat("length ", header.length));
  std::string payload(header.length, '\0');
  ASSIGN_OR_RETURN(whole, ReadAt(file, offset + static_cast<int64_t>(sizeof(header)),
                                 payload.size(), payload.data(), where));
  if (!whole) return 0;
  if (Crc32c(payload) != header.crc) return broken("its CRC-32C does not match");
  if (!event->ParseFromString(payload)) return broken("it is not an event");
  if (event->sequence() < 0 || event->sequence() > kMaxSequence) {
    return broken(absl::StrCat("sequence ", event->sequence()));
  }
  return static_cast<int64_t>(sizeof(header) + payload.size());
}

bool IsFirstRecord(const v1::JobEvent& event) {
  return event.event_case() == v1::JobEvent::EVENT_NOT_SET;
}

// Whether a preview of a worker is passed on to clients, which decode the picture.
bool IsShown(const v1::JobEvent::Preview& preview) {
  const auto is_side = [](int pixels) { return pixels > 0 && pixels <= kMaxEventSide; };
  return is_side(preview.width()) && is_side(preview.height()) && preview.step() >= 0 &&
         preview.step() <= preview.num_steps() && preview.jpeg().starts_with("\xff\xd8\xff") &&
         preview.jpeg().size() <= kMaxEventJpeg;
}

// Whether a worker may write the event. Only the server reports the job's state.
bool IsForWorkers(const v1::JobEvent& event) {
  return event.has_stage_started() || event.has_stage_ended() || event.has_progress() ||
         event.has_warning() || event.has_term_skipped() ||
         (event.has_preview() && IsShown(event.preview()));
}

void CleanWorkerEvent(v1::JobEvent& event) {
  event.DiscardUnknownFields();
  CleanTexts(event);
  if (!event.has_stage_ended()) return;
  google::protobuf::Map<std::string, double> metrics;
  for (const auto& [name, value] : event.stage_ended().metrics()) {
    if (metrics.size() < kMaxWorkerMetrics) metrics[ClientText(name, 100)] = value;
  }
  *event.mutable_stage_ended()->mutable_metrics() = std::move(metrics);
}

}  // namespace

absl::StatusOr<std::unique_ptr<EventLogWriter>> EventLogWriter::Open(
    const std::filesystem::path& path, int64_t fence, EventPart part) {
  EventLogReader reader(path);
  const EventLogReader::Position position = EventLogReader::PositionOf(fence, part);
  reader.end_ = position + 1;
  const std::filesystem::path file = path.parent_path() / reader.NameOf(position);
  const int descriptor =
      open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (descriptor < 0) return FileError(file, "open", errno);
  auto writer = std::unique_ptr<EventLogWriter>(new EventLogWriter(file, descriptor));
  RETURN_IF_ERROR(reader.ReadToEnd());
  writer->last_sequence_ = reader.last_sequence_;
  // The reader does not open a file without a first record.
  writer->size_ = reader.position_ == position ? reader.offset_ : 0;
  if (ftruncate(descriptor, writer->size_) != 0) return FileError(file, "truncate", errno);
  if (position > 0 && writer->size_ == 0) {
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
    return absl::InvalidArgumentError(
        absl::StrCat("an event of ", payload.size(), " bytes exceeds the limit of ", kMaxPayload));
  }
  std::memcpy(record.data(), &header, sizeof(header));
  record += payload;
  const ssize_t wrote = write(descriptor_, record.data(), record.size());
  if (wrote != static_cast<ssize_t>(record.size())) {
    absl::Status status = FileError(path_, "append", wrote < 0 ? errno : ENOSPC);
    // A torn record would hide the records after it.
    if (ftruncate(descriptor_, size_) != 0) return FileError(path_, "truncate", errno);
    return status;
  }
  size_ += wrote;
  return absl::OkStatus();
}

EventLogReader::Position EventLogReader::PositionOf(int64_t fence, EventPart part) {
  return fence * kNumParts + (fence == 0 ? 0 : static_cast<Position>(part));
}

bool EventLogReader::IsOfWorker(Position position) {
  return position % kNumParts == static_cast<Position>(EventPart::kWorker);
}

std::filesystem::path EventLogReader::NameOf(Position position) const {
  const int64_t fence = position / kNumParts;
  if (fence == 0) return path_.filename();
  const bool is_end = position % kNumParts == static_cast<Position>(EventPart::kAfter);
  const std::string name = absl::StrCat(path_.stem().string(), "-", fence, is_end ? "-end" : "",
                                        path_.extension().string());
  return IsOfWorker(position) ? std::filesystem::path(kWorkFolder) / name
                              : std::filesystem::path(name);
}

// Returns the position of the file with that name; 0: it is not a file of the log.
EventLogReader::Position EventLogReader::FindPosition(const std::string& name, bool in_work) const {
  const std::string prefix = path_.stem().string() + "-";
  if (!name.starts_with(prefix)) return 0;
  const size_t end = std::min(name.find_first_not_of("0123456789", prefix.size()), name.size());
  int64_t fence = 0;
  if (!absl::SimpleAtoi(name.substr(prefix.size(), end - prefix.size()), &fence)) return 0;
  if (fence <= 0 || fence > std::numeric_limits<int64_t>::max() / kNumParts - 1) return 0;
  for (const EventPart part : {EventPart::kBefore, EventPart::kWorker, EventPart::kAfter}) {
    const Position position = PositionOf(fence, part);
    if (IsOfWorker(position) == in_work && NameOf(position).filename() == name) return position;
  }
  return 0;
}

// Opens the file at a position. NOT_FOUND: it does not exist, or is a worker's and not a regular
// file.
absl::StatusOr<Descriptor> EventLogReader::OpenPart(const BeneathFolder& folder,
                                                    Position position) const {
  absl::StatusOr<Descriptor> file = folder.OpenFile(NameOf(position));
  if (file.ok() || absl::IsNotFound(file.status())) return file;
  if (!absl::IsFailedPrecondition(file.status())) return file;
  const std::string message(file.status().message());
  // The server's own files are always regular, unless the disk is broken.
  if (IsOfWorker(position)) return absl::NotFoundError(message);
  return absl::InternalError(message);
}

// Reads the first record of the file at a position; returns nothing if it has none yet.
absl::StatusOr<std::optional<EventLogReader::Successor>> EventLogReader::ReadFirstRecord(
    const BeneathFolder& folder, Position position) const {
  const absl::StatusOr<Descriptor> file = OpenPart(folder, position);
  if (absl::IsNotFound(file.status())) return std::nullopt;
  RETURN_IF_ERROR(file.status());
  v1::JobEvent event;
  const absl::StatusOr<int64_t> size = ReadRecord(*file, 0, NameOf(position).string(), &event);
  if (!size.ok() && !absl::IsDataLoss(size.status())) return size.status();
  if (!size.ok() || *size == 0 || !IsFirstRecord(event)) return std::nullopt;
  return Successor{position, event.sequence(), *size};
}

// Finds the next file, after this one and after `passed_over`, that has its first record.
absl::StatusOr<std::optional<EventLogReader::Successor>> EventLogReader::FindSuccessor(
    Position passed_over) const {
  std::optional<Successor> next;
  const absl::StatusOr<BeneathFolder> folder = BeneathFolder::Open(path_.parent_path());
  if (absl::IsNotFound(folder.status())) return next;
  RETURN_IF_ERROR(folder.status());
  const absl::StatusOr<BeneathFolder> work = folder->OpenFolder(kWorkFolder);
  for (const BeneathFolder* where : {&*folder, work.ok() ? &*work : nullptr}) {
    if (where == nullptr) continue;
    ASSIGN_OR_RETURN(const std::vector<BeneathFolder::Entry> entries, where->List());
    for (const BeneathFolder::Entry& entry : entries) {
      const Position position = FindPosition(entry.name, /*in_work=*/where != &*folder);
      if (position <= std::max(position_, passed_over) || position >= end_) continue;
      if (next && position >= next->position) continue;
      ASSIGN_OR_RETURN(const std::optional<Successor> first, ReadFirstRecord(*folder, position));
      if (first) next = first;
    }
  }
  return next;
}

// Reads events up to `last_sequence` from the file at position_.
absl::Status EventLogReader::ReadPart(int64_t last_sequence, size_t max_events,
                                      std::vector<v1::JobEvent>& events) {
  const absl::StatusOr<BeneathFolder> folder = BeneathFolder::Open(path_.parent_path());
  if (absl::IsNotFound(folder.status())) return absl::OkStatus();
  RETURN_IF_ERROR(folder.status());
  const absl::StatusOr<Descriptor> file = OpenPart(*folder, position_);
  if (absl::IsNotFound(file.status())) return absl::OkStatus();
  RETURN_IF_ERROR(file.status());
  const std::string name = (path_.parent_path() / NameOf(position_)).string();
  while (events.size() < max_events) {
    v1::JobEvent event;
    const std::string where = absl::StrCat(name, ": record at byte ", offset_);
    ASSIGN_OR_RETURN(const int64_t size, ReadRecord(*file, offset_, where, &event));
    if (size == 0 || event.sequence() > last_sequence) break;
    if (IsOfWorker(position_)) {
      if (event.sequence() != last_sequence_ + 1 || !IsForWorkers(event)) {
        return absl::DataLossError(absl::StrCat(where, ": it is not an event of a worker"));
      }
      CleanWorkerEvent(event);
    }
    offset_ += size;
    last_sequence_ = event.sequence();
    if (event.sequence() > after_sequence_) events.push_back(std::move(event));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<v1::JobEvent>> EventLogReader::Read(size_t max_events) {
  std::vector<v1::JobEvent> events;
  Position passed_over = 0;
  while (true) {
    // The order matters: once the next file exists, this one has all its events. If the next file
    // were looked for after the events are read, events written in between would be lost.
    const absl::StatusOr<std::optional<Successor>> found = FindSuccessor(passed_over);
    if (!found.ok() && events.empty()) return found.status();
    if (!found.ok()) return events;
    const std::optional<Successor>& next = *found;
    const absl::Status read =
        ReadPart(next ? next->last_sequence : Successor().last_sequence, max_events, events);
    // A later attempt continues after a broken record, but not after one that may yet be read.
    const bool passed = read.ok() || (next && absl::IsDataLoss(read));
    if (!passed && events.empty()) return read;
    if (!passed || !next || events.size() >= max_events) return events;
    if (IsOfWorker(next->position) && next->last_sequence > last_sequence_ + kMaxMissing) {
      passed_over = next->position;
      continue;
    }
    position_ = next->position;
    offset_ = next->offset;
    // A worker numbers its events from the last one that it could read, so a gap is no error here.
    if (IsOfWorker(position_)) last_sequence_ = next->last_sequence;
  }
}

// Reads all events, up to a broken record: the records after it cannot be found, so the writer cuts
// them off like a torn one. Returns an error of the disk, since the records may be readable later.
absl::Status EventLogReader::ReadToEnd() {
  while (true) {
    const absl::StatusOr<std::vector<v1::JobEvent>> events = Read();
    if (!events.ok() && !absl::IsDataLoss(events.status())) return events.status();
    if (!events.ok() || events->empty()) return absl::OkStatus();
  }
}

}  // namespace pepeseg
