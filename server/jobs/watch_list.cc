#include "server/jobs/watch_list.h"

namespace pepeseg {

class WatchList::Held : public Supervisor::Watch {
 public:
  Held(std::shared_ptr<Entries> entries, std::list<Entry>::iterator entry)
      : entries_(std::move(entries)), entry_(entry) {}
  ~Held() override {
    const std::lock_guard lock(entries_->mutex);
    entries_->list.erase(entry_);
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;

 private:
  std::shared_ptr<Entries> entries_;
  std::list<Entry>::iterator entry_;
};

std::unique_ptr<Supervisor::Watch> WatchList::Add(const std::string& job,
                                                  std::function<void()> changed) {
  const std::lock_guard lock(entries_->mutex);
  const auto entry = entries_->list.insert(entries_->list.end(), {job, std::move(changed)});
  return std::make_unique<Held>(entries_, entry);
}

void WatchList::Notify(const std::string& job) const {
  const std::lock_guard lock(entries_->mutex);
  for (const Entry& entry : entries_->list) {
    if (job.empty() || entry.job == job) entry.changed();
  }
}

}  // namespace pepeseg
