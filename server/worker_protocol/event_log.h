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
#include "pepeseg/v1/job_service.pb.h"
#include "server/worker_protocol/beneath_folder.h"

namespace pepeseg {

// The subfolder of a job's folder in which its worker writes.
inline constexpr char kWorkFolder[] = "work";

// The parts of an attempt's events, each with its own writer and file, in the order of reading.
enum class EventPart {
  kBefore = 0,  // the server, before there is a worker: "events-7.log"
  kWorker = 1,  // the worker: "work/events-7.log"
  kAfter = 2,   // the server, after the worker's end: "events-7-end.log"
};

// Limits of a preview that is taken from a worker: size of its JPEG, bytes, and of each side of the
// picture, pixels.
inline constexpr size_t kMaxEventJpeg = 30'000;
inline constexpr int kMaxEventSide = 640;

// Writes a job's events to append-only files. A record is the length of the payload (u32), its
// CRC-32C (u32) and the payload, a serialised JobEvent; little-endian. Events are numbered from 1
// without a gap.
//
// Each attempt has one file for each part. Events before the first attempt are in "events.log". The
// first record of a file has no event, only the number of the last event before it. Events that an
// attempt appends after it has lost its job have numbers above the one at which the next attempt
// took over, and are therefore never read.
//
// A file has one writer. The server never writes in the worker's folder, and does not trust what it
// reads there. A worker's file that is not a regular file counts as missing. One that reports the
// job's state, leaves out numbers, or has a preview that is not a JPEG within the limits above is
// broken from there on. Texts become ClientTexts.
class EventLogWriter {
 public:
  // Opens the log of `path`, the path of events.log, for one part of the attempt `fence` (0: before
  // the first). Continues after the last whole record of an earlier writer, part or attempt, and
  // cuts off a torn record after it. INTERNAL: the existing files cannot be read; they stay as they
  // are.
  static absl::StatusOr<std::unique_ptr<EventLogWriter>> Open(const std::filesystem::path& path,
                                                              int64_t fence = 0,
                                                              EventPart part = EventPart::kBefore);
  ~EventLogWriter();
  EventLogWriter(const EventLogWriter&) = delete;
  EventLogWriter& operator=(const EventLogWriter&) = delete;

  // Appends the event with the next sequence number and, if it has no time, the current time. One
  // write, so that a reader sees the whole record or none of it. Does not sync: a power cut may
  // lose the newest events.
  absl::Status Append(v1::JobEvent event);
  int64_t last_sequence() const { return last_sequence_; }

 private:
  EventLogWriter(std::filesystem::path path, int descriptor)
      : path_(std::move(path)), descriptor_(descriptor) {}
  absl::Status Write(const v1::JobEvent& event);

  std::filesystem::path path_;  // path of the file that it writes
  int descriptor_;
  int64_t last_sequence_ = 0;
  int64_t size_ = 0;  // size of the file, bytes
};

// Reads a log, also while it grows. Not thread safe; any number of readers may read one log.
class EventLogReader {
 public:
  // Reads the events after number `after_sequence`. `path`: path of events.log, which need not
  // exist yet.
  explicit EventLogReader(std::filesystem::path path, int64_t after_sequence = 0)
      : path_(std::move(path)), after_sequence_(after_sequence) {}

  // Returns the events since the last call, at most `max_events`; none if there are no new ones. A
  // record that is cut short counts as not yet written. DATA_LOSS: a record fails its CRC, and no
  // later attempt continues from there; earlier calls have returned the events before it. INTERNAL:
  // the disk failed; the call can be repeated.
  absl::StatusOr<std::vector<v1::JobEvent>> Read(size_t max_events = 1000);

  // Returns the fence of the attempt whose file is being read.
  int64_t fence() const { return position_ / kNumParts; }
  // Returns the number of the last event that was read.
  int64_t last_sequence() const { return last_sequence_; }

 private:
  friend class EventLogWriter;
  // Number of a file in the order of reading: rises from part to part, and from attempt to attempt.
  using Position = int64_t;
  static constexpr int kNumParts = 3;
  // The next file to read.
  struct Successor {
    Position position = 0;
    int64_t last_sequence = std::numeric_limits<int64_t>::max();  // number before its first event
    int64_t offset = 0;                                           // where its first event is, bytes
  };
  static Position PositionOf(int64_t fence, EventPart part);
  static bool IsOfWorker(Position position);
  // Returns the path of a file relative to the job's folder.
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
  Position end_ = std::numeric_limits<Position>::max();  // files from here on are not read
  Position position_ = 0;
  int64_t offset_ = 0;  // where the next record is, bytes
  int64_t last_sequence_ = 0;
};

}  // namespace pepeseg
