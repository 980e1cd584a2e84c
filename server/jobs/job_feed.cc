#include "server/jobs/job_feed.h"

#include <algorithm>
#include <utility>

namespace pepeseg {

// Removes its entry from the list when it is destroyed.
class JobFeed::HeldWatch : public Watch {
 public:
  HeldWatch(std::shared_ptr<Watches> watches, std::list<WatchEntry>::iterator entry)
      : watches_(std::move(watches)), entry_(entry) {}
  ~HeldWatch() override {
    const std::lock_guard lock(watches_->mutex);
    watches_->list.erase(entry_);
  }
  HeldWatch(const HeldWatch&) = delete;
  HeldWatch& operator=(const HeldWatch&) = delete;

 private:
  // Shared, so that a stream that outlives the feed can still remove its watch.
  std::shared_ptr<Watches> watches_;
  std::list<WatchEntry>::iterator entry_;
};

void JobFeed::SetNewest(const std::string& job, const Newest& newest) {
  const std::lock_guard lock(mutex_);
  newest_[job] = newest;
}

std::optional<JobFeed::Newest> JobFeed::FindNewest(const std::string& job) const {
  const std::lock_guard lock(mutex_);
  const auto found = newest_.find(job);
  return found == newest_.end() ? std::nullopt : std::optional(found->second);
}

void JobFeed::SetObstacle(const std::string& job, const absl::Status& error) {
  {
    const std::lock_guard lock(mutex_);
    obstacles_[job] = error;
  }
  Notify(job);
}

void JobFeed::ClearObstacle(const std::string& job) {
  const std::lock_guard lock(mutex_);
  obstacles_.erase(job);
}

absl::Status JobFeed::FindObstacle(const std::string& job, bool queued) const {
  const std::lock_guard lock(mutex_);
  auto found = obstacles_.find(job);
  // The obstacle without a job holds up all queued jobs: no job can be claimed.
  if (found == obstacles_.end() && queued) found = obstacles_.find("");
  return found == obstacles_.end() ? absl::OkStatus() : found->second;
}

void JobFeed::KeepObstaclesOf(const std::vector<JobRecord>& held) {
  const std::lock_guard lock(mutex_);
  std::erase_if(obstacles_, [&](const auto& obstacle) {
    return !obstacle.first.empty() &&
           std::none_of(held.begin(), held.end(),
                        [&](const JobRecord& record) { return record.id == obstacle.first; });
  });
}

void JobFeed::Forget(const std::string& job) {
  const std::lock_guard lock(mutex_);
  newest_.erase(job);
  obstacles_.erase(job);
}

std::unique_ptr<JobFeed::Watch> JobFeed::AddWatch(const std::string& job,
                                                  std::function<void()> changed) {
  const std::lock_guard lock(watches_->mutex);
  const auto entry = watches_->list.insert(watches_->list.end(), {job, std::move(changed)});
  return std::make_unique<HeldWatch>(watches_, entry);
}

void JobFeed::Notify(const std::string& job) const {
  const std::lock_guard lock(watches_->mutex);
  for (const WatchEntry& entry : watches_->list) {
    // Under the mutex, so that a watch that is being destroyed is not called: `changed` must be
    // short and must not add or remove watches.
    if (job.empty() || entry.job == job) entry.changed();
  }
}

}  // namespace pepeseg
