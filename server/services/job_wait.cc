#include "server/services/job_wait.h"

#include <algorithm>

#include "absl/time/clock.h"
#include "server/api/convert.h"

namespace pepeseg {

void JobWaits::Fill(const JobRecord& record, v1::Job& job) {
  if (record.state != JobState::kQueued) return;
  if (record.not_before > absl::Now()) {
    job.mutable_wait()->set_reason(v1::Job::Wait::REASON_RETRY);
    *job.mutable_wait()->mutable_retry_time() = ToProto(record.not_before);
    return;
  }
  if (!claimable_) {
    auto listed = store_.queue().ListClaimable();
    if (!listed.ok()) return;
    claimable_ = *std::move(listed);
  }
  const auto found = std::find(claimable_->begin(), claimable_->end(), record.number);
  const auto ahead = static_cast<int32_t>(found - claimable_->begin());
  // A job that is not in a whole list may not be claimed; in a full list it may be too far behind.
  if (found == claimable_->end() && ahead < JobQueue::kMostListed) {
    job.mutable_wait()->set_reason(v1::Job::Wait::REASON_QUOTA);
    return;
  }
  job.mutable_wait()->set_reason(v1::Job::Wait::REASON_DEVICE);
  job.mutable_wait()->set_jobs_ahead(ahead);
}

}  // namespace pepeseg
