#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/base/beneath_folder.h"
#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg {

// Name of the folder, in a job's, in which its worker writes.
inline constexpr char kWorkFolder[] = "work";

// Who writes a part of an attempt's events, in the order in which the parts are read.
enum class EventPart {
  kBefore = 0,  // the server, before there is a worker: "events-7.log"
  kWorker = 1,  // the worker: "work/events-7.log"
  kAfter = 2,   // the server, after the worker's end: "events-7-end.log"
};

// A job's events as append-only files: records of length (u32), CRC-32C of the payload (u32) and
// the payload, a serialised JobEvent; little-endian. Events are numbered from 1 without a gap.
//
// Each attempt has files of its own, one for each part, next to that of what happened before the
// first, "events.log". The first record of a file holds the number after which it continues, and
// nothing else. What an attempt that lost its claim still appends to its file therefore comes after
// the number at which the next one took over, and is read by nobody.
//
// A file has one writer. The server never writes in the worker's folder, and what it reads there it
// does not trust: a worker's file that is no plain file is not there; one that reports the state of
// the job, or leaves out numbers, is broken from there on; texts are ClientTexts.
class EventLogWriter {
 public:
  // `path`: of events.log; `fence`: of the attempt, 0: before the first. Continues after the last
  // whole record of an earlier writer, part or attempt; what is torn behind it is cut off.
  // INTERNAL: what is there cannot be read, and stays as it is.
  static absl::StatusOr<std::unique_ptr<EventLogWriter>> Open(const std::filesystem::path& path,
                                                              int64_t fence = 0,
                                                              EventPart part = EventPart::kBefore);
  ~EventLogWriter();
  EventLogWriter(const EventLogWriter&) = delete;
  EventLogWriter& operator=(const EventLogWriter&) = delete;

  // Gives the event its sequence and, when it has none, its time. In one write, so that a reader
  // sees it whole or not at all; not synced: a power cut may lose the newest.
  absl::Status Append(v1::JobEvent event);
  int64_t last_sequence() const { return last_sequence_; }

 private:
  EventLogWriter(std::filesystem::path path, int descriptor)
      : path_(std::move(path)), descriptor_(descriptor) {}
  absl::Status Write(const v1::JobEvent& event);

  std::filesystem::path path_;  // of its own file
  int descriptor_;
  int64_t last_sequence_ = 0;
  int64_t size_ = 0;  // of the file, bytes
};

// Reads a log, also while it grows. Not thread safe; any number of readers may read one log.
class EventLogReader {
 public:
  // From the event after `after_sequence` on. The file need not be there yet. `path`: of
  // events.log.
  explicit EventLogReader(std::filesystem::path path, int64_t after_sequence = 0)
      : path_(std::move(path)), after_sequence_(after_sequence) {}

  // What has come since the last call, at most `max_events`; empty: nothing yet. A record that is
  // cut short is not there yet; one that fails its CRC is DATA_LOSS, reported after those before
  // it, unless a later attempt continues from there. INTERNAL: the disk does not say; ask again.
  absl::StatusOr<std::vector<v1::JobEvent>> Read(size_t max_events = 1000);

  // The attempt whose file is read.
  int64_t fence() const { return position_ / kNumParts; }
  // Of the last whole record, stale ones left out.
  int64_t last_sequence() const { return last_sequence_; }

 private:
  friend class EventLogWriter;
  // Of a file among those of a job: rises from part to part, and from attempt to attempt.
  using Position = int64_t;
  static constexpr int kNumParts = 3;
  struct Successor {
    Position position = 0;
    int64_t last_sequence = std::numeric_limits<int64_t>::max();  // before its first event
    int64_t offset = 0;                                           // of its first event, bytes
  };
  static Position PositionOf(int64_t fence, EventPart part);
  static bool IsOfWorker(Position position);
  // Relative to the job's folder.
  std::filesystem::path NameOf(Position position) const;
  Position FindPosition(const std::string& name, bool in_work) const;
  absl::StatusOr<std::optional<Successor>> FindSuccessor(Position passed_over) const;
  absl::StatusOr<std::optional<Successor>> ReadFirstRecord(const BeneathFolder& folder,
                                                           Position position) const;
  absl::StatusOr<Descriptor> OpenPart(const BeneathFolder& folder, Position position) const;
  absl::Status ReadPart(int64_t last_sequence, size_t max_events,
                        std::vector<v1::JobEvent>& events);
  absl::Status ReadToEnd();

  std::filesystem::path path_;
  int64_t after_sequence_;
  Position end_ = std::numeric_limits<Position>::max();  // files from here on are left out
  Position position_ = 0;
  int64_t offset_ = 0;  // of the next record, bytes
  int64_t last_sequence_ = 0;
};

}  // namespace pepeseg
