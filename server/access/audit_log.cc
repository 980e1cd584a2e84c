#include "server/access/audit_log.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/time/clock.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// Limit for each resource name in a line, as names come from clients.
constexpr size_t kMaxNameBytes = 256;

std::string TextOf(absl::Time time) {
  return absl::FormatTime(absl::RFC3339_full, time, absl::UTCTimeZone());
}

std::string LineOf(const AuditEntry& entry) {
  nlohmann::ordered_json line;
  line["time"] = TextOf(absl::Now());
  line["key"] = entry.key;
  if (!entry.subject.empty()) line["subject"] = entry.subject;
  line["project"] = entry.project;
  line["peer"] = entry.peer;
  line["method"] = entry.method;
  line["resources"] = nlohmann::json::array();
  for (const std::string& name : entry.resources) {
    line["resources"].push_back(name.substr(0, kMaxNameBytes));
  }
  line["outcome"] = entry.outcome;
  if (!entry.call.empty()) line["call"] = entry.call;
  if (!entry.reason.empty()) line["reason"] = entry.reason;
  // ASCII only, with other characters escaped: a client's name cannot break a line or forge one.
  return line.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace

std::string NewAuditCall() {
  std::array<char, 8> bytes;
  // No random bits are there only early in a system's start; the time is different, too.
  if (getentropy(bytes.data(), bytes.size()) != 0) {
    return absl::StrCat(absl::Hex(absl::ToUnixNanos(absl::Now()), absl::kZeroPad16));
  }
  return absl::BytesToHexString(absl::string_view(bytes.data(), bytes.size()));
}

absl::StatusOr<std::unique_ptr<AuditLog>> AuditLog::Open(const std::filesystem::path& path,
                                                         const Limits& limits) {
  auto log = std::unique_ptr<AuditLog>(new AuditLog(path, limits));
  RETURN_IF_ERROR(log->Reopen());
  return log;
}

AuditLog::~AuditLog() {
  if (descriptor_ >= 0) close(descriptor_);
}

absl::Status AuditLog::Reopen() {
  const int opened = open(path_.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
  // The old descriptor stays, so that lines are not lost while a new file cannot be made.
  if (opened < 0) return FileError(path_, "cannot open", errno);
  if (descriptor_ >= 0) close(descriptor_);
  descriptor_ = opened;
  name_is_durable_ = false;  // the file may be new
  return absl::OkStatus();
}

// Returns whether the path is no longer that of the open file: another process has rotated it, or
// logrotate.
bool AuditLog::IsMoved() const {
  struct stat ours {};
  struct stat there {};
  return stat(path_.c_str(), &there) != 0 || fstat(descriptor_, &ours) != 0 ||
         ours.st_ino != there.st_ino || ours.st_dev != there.st_dev;
}

absl::Status AuditLog::RotateWhenFull() {
  struct stat now {};
  if (fstat(descriptor_, &now) != 0 || now.st_size < limits_.max_bytes) return absl::OkStatus();
  // The first of several processes rotates; the others then find the file moved. Closing the
  // descriptor releases the lock.
  if (flock(descriptor_, LOCK_EX) != 0) return FileError(path_, "cannot lock", errno);
  if (!IsMoved()) {
    const auto numbered = [this](int i) {
      std::filesystem::path path = path_;
      return path += absl::StrCat(".", i);
    };
    std::error_code ignored;  // there may be no such file yet
    // From the oldest on, so that no file is overwritten before it has moved; the last one is
    // dropped.
    for (int i = limits_.kept - 1; i >= 1; --i) {
      std::filesystem::rename(numbered(i), numbered(i + 1), ignored);
    }
    std::error_code error;
    std::filesystem::rename(path_, numbered(1), error);
    if (error) {
      // The descriptor stays open: other processes that write to the file must not wait for it.
      flock(descriptor_, LOCK_UN);
      return FileError(path_, "cannot rotate", error.value());
    }
  }
  return Reopen();
}

absl::Status AuditLog::Append(const std::string& line, bool durable) {
  if (IsMoved()) RETURN_IF_ERROR(Reopen());
  RETURN_IF_ERROR(RotateWhenFull());
  // One write with O_APPEND, so that lines of several processes do not mix.
  const ssize_t written = write(descriptor_, line.data(), line.size());
  if (written != static_cast<ssize_t>(line.size())) {
    return FileError(path_, "cannot write", written < 0 ? errno : ENOSPC);
  }
  return durable ? Sync() : absl::OkStatus();
}

absl::Status AuditLog::Sync() {
  if (fdatasync(descriptor_) != 0) return FileError(path_, "cannot sync", errno);
  if (!name_is_durable_) RETURN_IF_ERROR(SyncFolder(path_.parent_path()));
  name_is_durable_ = true;
  return absl::OkStatus();
}

void AuditLog::Write(const AuditEntry& entry) { WriteLine(LineOf(entry), /*durable=*/false); }

void AuditLog::WriteDurably(const AuditEntry& entry) { WriteLine(LineOf(entry), /*durable=*/true); }

void AuditLog::WriteLeftOut(int64_t count, absl::Time since) {
  nlohmann::ordered_json line;
  line["time"] = TextOf(absl::Now());
  line["left_out"] = count;
  line["since"] = TextOf(since);
  WriteLine(line.dump() + "\n", /*durable=*/false);
}

void AuditLog::WriteLine(const std::string& line, bool durable) {
  const std::lock_guard lock(mutex_);
  const absl::Status status = Append(line, durable);
  // Logged once for each series of failures. A full disk does not stop the service.
  if (!status.ok() && !failing_) {
    spdlog::error("audit log: {}: calls are not recorded", std::string(status.message()));
  }
  failing_ = !status.ok();
}

absl::StatusOr<std::unique_ptr<RefusalLog>> RefusalLog::Open(const std::filesystem::path& path,
                                                             const Limits& limits) {
  ASSIGN_OR_RETURN(std::unique_ptr<AuditLog> file, AuditLog::Open(path, limits.file));
  return std::unique_ptr<RefusalLog>(new RefusalLog(std::move(file), limits));
}

RefusalLog::~RefusalLog() { SummarizeLocked(); }

// The bucket fills with lines_per_second up to burst. A clock that steps back adds nothing.
bool RefusalLog::TakeTokenLocked(absl::Time now) {
  const double earned = absl::ToDoubleSeconds(now - filled_) * limits_.lines_per_second;
  tokens_ = std::clamp(tokens_ + std::max(earned, 0.0), 0.0, limits_.burst);
  filled_ = now;
  if (tokens_ < 1) return false;
  --tokens_;
  return true;
}

void RefusalLog::SummarizeLocked() {
  if (num_left_out_ == 0) return;
  file_->WriteLeftOut(num_left_out_, left_out_since_);
  num_left_out_ = 0;
}

void RefusalLog::Write(const AuditEntry& entry, absl::Time now) {
  const std::lock_guard lock(mutex_);
  const bool write = TakeTokenLocked(now);
  if (!write && ++num_left_out_ == 1) left_out_since_ = now;
  if (num_left_out_ > 0 && now - left_out_since_ >= limits_.summary_interval) SummarizeLocked();
  if (write) file_->Write(entry);
}

}  // namespace pepeseg
