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

// The subfolder of a job's folder in which its worker writes.
inline constexpr char kWorkFolder[] = "work";

// The part of an attempt's events, by writer, in the order in which the parts are read.
enum class EventPart {
  kBefore = 0,  // the server, before there is a worker: "events-7.log"
  kWorker = 1,  // the worker: "work/events-7.log"
  kAfter = 2,   // the server, after the worker's end: "events-7-end.log"
};

// Writes a job's events to append-only files. A record is the length (u32), the CRC-32C of the
// payload (u32) and the payload, a serialised JobEvent; little-endian. Events are numbered from 1
// without a gap.
//
// Each attempt has one file for each part. Events before the first attempt are in "events.log". The
// first record of a file only has the number after which the file continues. What an attempt that
// lost its claim still appends to its file comes after the number at which the next attempt took
// over, and is therefore never read.
//
// A file has one writer. The server never writes in the worker's folder, and does not trust what it
// reads there: a worker's file that is not a plain file counts as missing; one that reports the
// state of the job, or leaves out numbers, is broken from there on; texts become ClientTexts.
class EventLogWriter {
 public:
  // `path`: of events.log; `fence`: of the attempt, 0: before the first. Continues after the last
  // whole record of an earlier writer, part or attempt; a torn record after it is cut off.
  // INTERNAL: the existing files cannot be read; they stay as they are.
  static absl::StatusOr<std::unique_ptr<EventLogWriter>> Open(const std::filesystem::path& path,
                                                              int64_t fence = 0,
                                                              EventPart part = EventPart::kBefore);
  ~EventLogWriter();
  EventLogWriter(const EventLogWriter&) = delete;
  EventLogWriter& operator=(const EventLogWriter&) = delete;

  // Appends the event with the next sequence number and, when it has none, the current time. It is
  // one write, so that a reader sees all of it or nothing. Not synced: a power cut may lose the
  // newest events.
  absl::Status Append(v1::JobEvent event);
  int64_t last_sequence() const { return last_sequence_; }

 private:
  EventLogWriter(std::filesystem::path path, int descriptor)
      : path_(std::move(path)), descriptor_(descriptor) {}
  absl::Status Write(const v1::JobEvent& event);

  std::filesystem::path path_;  // of the file that it writes
  int descriptor_;
  int64_t last_sequence_ = 0;
  int64_t size_ = 0;  // of the file, bytes
};

// Reads a log, also while it grows. Not thread safe; any number of readers may read one log.
class EventLogReader {
 public:
  // Reads from the event after `after_sequence` on. The file need not exist yet. `path`: of
  // events.log.
  explicit EventLogReader(std::filesystem::path path, int64_t after_sequence = 0)
      : path_(std::move(path)), after_sequence_(after_sequence) {}

  // Returns the events since the last call, at most `max_events`; empty: none yet. A record that is
  // cut short counts as not yet written. DATA_LOSS: a record fails its CRC, and no later attempt
  // continues from there; the events before it are returned first. INTERNAL: the disk failed; the
  // call can be repeated.
  absl::StatusOr<std::vector<v1::JobEvent>> Read(size_t max_events = 1000);

  // Fence of the attempt whose file is being read.
  int64_t fence() const { return position_ / kNumParts; }
  // Sequence of the last whole record that is not stale.
  int64_t last_sequence() const { return last_sequence_; }

 private:
  friend class EventLogWriter;
  // Orders the files of a job: rises from part to part, and from attempt to attempt.
  using Position = int64_t;
  static constexpr int kNumParts = 3;
  struct Successor {
    Position position = 0;
    int64_t last_sequence = std::numeric_limits<int64_t>::max();  // before its first event
    int64_t offset = 0;                                           // of its first event, bytes
  };
  static Position PositionOf(int64_t fence, EventPart part);
  static bool IsOfWorker(Position position);
  // The file's name, relative to the job's folder.
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
