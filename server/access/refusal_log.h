#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "server/access/audit_log.h"

namespace pepeseg {

// Refusals of callers that have shown no valid key, in a file of their own: whoever can reach the
// server can cause as many as they like, and must not be able to rotate the audit log away. Same
// format as AuditLog. Lines beyond a rate are left out and counted: {"time", "left_out": how many,
// "since": when the first of them came}. Thread safe.
class RefusalLog {
 public:
  struct Limits {
    double lines_per_second = 10;
    double burst = 100;                                   // lines
    absl::Duration summary_interval = absl::Seconds(10);  // between lines with a count
    AuditLog::Limits file = {int64_t{16} << 20, 3};
  };
  static absl::StatusOr<std::unique_ptr<RefusalLog>> Open(const std::filesystem::path& path,
                                                          const Limits& limits);
  // Writes the count of what was left out last.
  ~RefusalLog();
  RefusalLog(const RefusalLog&) = delete;
  RefusalLog& operator=(const RefusalLog&) = delete;

  void Write(const AuditEntry& entry, absl::Time now = absl::Now());

 private:
  RefusalLog(std::unique_ptr<AuditLog> file, const Limits& limits)
      : limits_(limits), file_(std::move(file)), tokens_(limits.burst) {}
  bool TakeTokenLocked(absl::Time now);
  void SummarizeLocked();

  const Limits limits_;
  const std::unique_ptr<AuditLog> file_;
  std::mutex mutex_;  // guards all below
  double tokens_;     // lines that may be written at once
  absl::Time filled_ = absl::InfinitePast();
  int64_t num_left_out_ = 0;
  absl::Time left_out_since_;
};

}  // namespace pepeseg
