#pragma once

#include <cstddef>
#include <list>
#include <string>
#include <utility>

namespace pepeseg {

// The most recently used answers, by key. Not thread safe.
template <typename Answer>
class RecentAnswers {
 public:
  explicit RecentAnswers(size_t most) : most_(most) {}

  // Returns an answer, which is then the most recent one, or null. It stays until the next Keep.
  const Answer* Find(const std::string& key) {
    for (auto at = kept_.begin(); at != kept_.end(); ++at) {
      if (at->first != key) continue;
      kept_.splice(kept_.begin(), kept_, at);
      return &kept_.front().second;
    }
    return nullptr;
  }
  // Keeps an answer and drops the one that was not used for the longest time. Returns it.
  const Answer* Keep(std::string key, Answer answer) {
    kept_.emplace_front(std::move(key), std::move(answer));
    if (kept_.size() > most_) kept_.pop_back();
    return &kept_.front().second;
  }

 private:
  const size_t most_;
  std::list<std::pair<std::string, Answer>> kept_;  // the most recent first
};

}  // namespace pepeseg
