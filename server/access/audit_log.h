#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
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

}  // namespace pepeseg
