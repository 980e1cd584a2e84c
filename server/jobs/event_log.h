#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg {

// A job's events as an append-only file: records of length (u32), CRC-32C of the payload (u32) and
// the payload, a serialised JobEvent; little-endian. Events are numbered from 1 without a gap.
//
// There is one writer at a time: the worker while it lives, the supervisor before and after. Not
// thread safe.
class EventLogWriter {
 public:
  // Goes on after the last whole record of an earlier writer; what is torn behind it is cut off.
  static absl::StatusOr<std::unique_ptr<EventLogWriter>> Open(const std::filesystem::path& path);
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

  std::filesystem::path path_;
  int descriptor_;
  int64_t last_sequence_ = 0;
  int64_t size_ = 0;  // of the file, bytes
};

// Reads a log, also while it grows. Not thread safe; any number of readers may read one log.
class EventLogReader {
 public:
  // From the event after `after_sequence` on. The file need not be there yet.
  explicit EventLogReader(std::filesystem::path path, int64_t after_sequence = 0)
      : path_(std::move(path)), after_sequence_(after_sequence) {}

  // What has come since the last call, at most `max_events`; empty: nothing yet. A record that is
  // cut short is not there yet; one that fails its CRC is DATA_LOSS, told after those before it.
  absl::StatusOr<std::vector<v1::JobEvent>> Read(size_t max_events = 1000);

  // Where the next record begins, bytes.
  int64_t offset() const { return offset_; }

 private:
  absl::StatusOr<bool> ReadRecord(std::ifstream& stream, v1::JobEvent* event);

  std::filesystem::path path_;
  int64_t after_sequence_;
  int64_t offset_ = 0;
};

}  // namespace pepeseg
