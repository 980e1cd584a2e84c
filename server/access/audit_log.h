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

// A line of a log: a call that was refused, or one that was made. A call that changes something has
// two lines with the same `call`: kBegun before anything is changed, then its outcome.
struct AuditEntry {
  static constexpr char kBegun[] = "BEGUN";

  std::string key;      // id; empty: no valid key
  std::string project;  // of the key or the gateway identity
  std::string peer;     // gRPC's name for the other end of the connection
  std::string method;   // "pepeseg.v1.SceneService.GetScene"
  std::vector<std::string> resources;
  std::string outcome;       // kBegun, or the name of a gRPC status code
  std::string reason;        // of a refusal, as "EXPIRED_KEY"; may be empty
  std::string subject = {};  // of the gateway identity; empty: none
  std::string call = {};     // NewAuditCall() of a call with two lines; empty: it has one line
};

// Returns a new random id for the two lines of a call.
std::string NewAuditCall();

// A file with one JSON object per line, readable by its owner only (0600). When it reaches
// `max_bytes` it becomes PATH.1, PATH.1 becomes PATH.2 and so on, up to PATH.`kept`. Several
// processes may write to one file. Thread safe. A line that cannot be written is reported in the
// server's log and does not fail the call.
class AuditLog {
 public:
  struct Limits {
    int64_t max_bytes = int64_t{64} << 20;  // size at which the file is rotated
    int kept = 8;                           // number of older files
  };

  static absl::StatusOr<std::unique_ptr<AuditLog>> Open(const std::filesystem::path& path,
                                                        const Limits& limits);
  ~AuditLog();
  AuditLog(const AuditLog&) = delete;
  AuditLog& operator=(const AuditLog&) = delete;

  void Write(const AuditEntry& entry);
  // Writes a line, and returns when it is on the disk: a change that the database keeps over a
  // power cut must not lose its line.
  void WriteDurably(const AuditEntry& entry);
  // Writes a line for `count` entries that were left out, the first of them at `since`.
  void WriteLeftOut(int64_t count, absl::Time since);

 private:
  void WriteLine(const std::string& line, bool durable);
  AuditLog(std::filesystem::path path, const Limits& limits)
      : path_(std::move(path)), limits_(limits) {}
  absl::Status Append(const std::string& line, bool durable);
  absl::Status Sync();
  absl::Status Reopen();
  // Returns whether the open file no longer has the path, because another process rotated it.
  bool IsMoved() const;
  absl::Status RotateWhenFull();

  const std::filesystem::path path_;
  const Limits limits_;
  std::mutex mutex_;
  int descriptor_ = -1;
  bool name_is_durable_ = false;  // the folder was synced since the file was opened
  bool failing_ = false;  // the last write failed; a full disk is logged once, not for every call
};

// Refusals of callers without a valid key, in a file of their own: anybody who can reach the server
// can cause any number of them, and must not be able to rotate the audit log away. Same format as
// AuditLog. Lines beyond a rate are left out and counted in lines of the form {"time", "left_out":
// number, "since": time of the first}. Thread safe.
class RefusalLog {
 public:
  struct Limits {
    double lines_per_second = 10;
    double burst = 100;                                   // lines that may be written at once
    absl::Duration summary_interval = absl::Seconds(10);  // between lines with a count
    AuditLog::Limits file = {int64_t{16} << 20, 3};
  };
  static absl::StatusOr<std::unique_ptr<RefusalLog>> Open(const std::filesystem::path& path,
                                                          const Limits& limits);
  // Writes the count of the lines left out since the last summary.
  ~RefusalLog();
  RefusalLog(const RefusalLog&) = delete;
  RefusalLog& operator=(const RefusalLog&) = delete;

  void Write(const AuditEntry& entry, absl::Time now = absl::Now());

 private:
  RefusalLog(std::unique_ptr<AuditLog> file, const Limits& limits)
      : limits_(limits), file_(std::move(file)), tokens_(limits.burst) {}
  // Token bucket: returns whether a line may be written now.
  bool TakeTokenLocked(absl::Time now);
  // Writes the count of the lines left out, if there are any.
  void SummarizeLocked();

  const Limits limits_;
  const std::unique_ptr<AuditLog> file_;
  std::mutex mutex_;  // guards all below
  double tokens_;     // lines that may be written at `filled_`
  absl::Time filled_ = absl::InfinitePast();
  int64_t num_left_out_ = 0;
  absl::Time left_out_since_;
};

}  // namespace pepeseg
