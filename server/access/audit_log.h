#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace pepeseg {

// What somebody did, or was not let do.
struct AuditEntry {
  std::string key;      // id; empty: none that is known
  std::string project;  // of the key
  std::string peer;     // gRPC's name of where the call came from
  std::string method;   // "pepeseg.v1.SceneService.GetScene"
  std::vector<std::string> resources;
  std::string outcome;       // a gRPC code's name
  std::string reason;        // of a refusal: "EXPIRED_KEY"; may be empty
  std::string subject = {};  // whom a gateway vouches for; empty: none does
};

// A file of one JSON object a line, for its owner's eyes only (0600). At `max_bytes` it becomes
// PATH.1, that PATH.2 and so on, `kept` of them. Several processes may write to one. Thread safe; a
// line that cannot be written is told in the server's log, and the call goes on.
class AuditLog {
 public:
  struct Limits {
    int64_t max_bytes = int64_t{64} << 20;
    int kept = 8;
  };

  static absl::StatusOr<std::unique_ptr<AuditLog>> Open(const std::filesystem::path& path,
                                                        const Limits& limits);
  ~AuditLog();
  AuditLog(const AuditLog&) = delete;
  AuditLog& operator=(const AuditLog&) = delete;

  void Write(const AuditEntry& entry);
  // A line for `count` entries that were left out, the first of them at `since`.
  void WriteLeftOut(int64_t count, absl::Time since);

 private:
  void WriteLine(const std::string& line);
  AuditLog(std::filesystem::path path, const Limits& limits)
      : path_(std::move(path)), limits_(limits) {}
  absl::Status Append(const std::string& line);
  absl::Status Reopen();
  // Whether another process has rotated the file away under us.
  bool IsMoved() const;
  absl::Status RotateWhenFull();

  const std::filesystem::path path_;
  const Limits limits_;
  std::mutex mutex_;
  int descriptor_ = -1;
  bool failing_ = false;  // so that a full disk is told once, not with every call
};

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
