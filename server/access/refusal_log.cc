#include "server/access/refusal_log.h"

#include <algorithm>

#include "core/base/status_macros.h"

namespace pepeseg {

absl::StatusOr<std::unique_ptr<RefusalLog>> RefusalLog::Open(const std::filesystem::path& path,
                                                             const Limits& limits) {
  ASSIGN_OR_RETURN(std::unique_ptr<AuditLog> file, AuditLog::Open(path, limits.file));
  return std::unique_ptr<RefusalLog>(new RefusalLog(std::move(file), limits));
}

RefusalLog::~RefusalLog() { SummarizeLocked(); }

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
