#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg {

// A job's events as append-only files: records of length (u32), CRC-32C of the payload (u32) and
// the payload, a serialised JobEvent; little-endian. Events are numbered from 1 without a gap.
//
// Each attempt has a file of its own, beside that of what happened before the first: "events.log",
// "events-1.log", "events-2.log" ... Its first record holds the number after which it goes on, and
// nothing else. What an attempt that lost its claim still appends to its file so comes after the
// number at which the next one took over, and is read by nobody.
//
// A file has one writer at a time: the worker while it lives, the supervisor before and after. Not
// thread safe.
class EventLogWriter {
 public:
  // `path`: of events.log; `fence`: of the attempt, 0: before the first. Goes on after the last
  // whole record of an earlier writer, or attempt; what is torn behind it is cut off. INTERNAL:
  // what is there cannot be read, and stays as it is.
  static absl::StatusOr<std::unique_ptr<EventLogWriter>> Open(const std::filesystem::path& path,
                                                              int64_t fence = 0);
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
  // events.log; attempts from `end_fence` on are left out.
  explicit EventLogReader(std::filesystem::path path, int64_t after_sequence = 0,
                          int64_t end_fence = std::numeric_limits<int64_t>::max())
      : path_(std::move(path)), after_sequence_(after_sequence), end_fence_(end_fence) {}

  // What has come since the last call, at most `max_events`; empty: nothing yet. A record that is
  // cut short is not there yet; one that fails its CRC is DATA_LOSS, told after those before it,
  // unless a later attempt went on from there. INTERNAL: the disk does not say; ask again.
  absl::StatusOr<std::vector<v1::JobEvent>> Read(size_t max_events = 1000);

  // The attempt whose file is read, and where its next record begins, bytes.
  int64_t fence() const { return fence_; }
  int64_t offset() const { return offset_; }
  // Of the last whole record, stale ones left out.
  int64_t last_sequence() const { return last_sequence_; }

 private:
  struct Successor {
    int64_t fence = 0;
    int64_t last_sequence = std::numeric_limits<int64_t>::max();  // before its first event
    int64_t offset = 0;                                           // of its first event, bytes
  };
  absl::StatusOr<std::optional<Successor>> FindSuccessor() const;
  absl::Status ReadFile(int64_t last_sequence, size_t max_events,
                        std::vector<v1::JobEvent>& events);

  std::filesystem::path path_;
  int64_t after_sequence_;
  int64_t end_fence_;
  int64_t fence_ = 0;
  int64_t offset_ = 0;
  int64_t last_sequence_ = 0;
};

}  // namespace pepeseg
