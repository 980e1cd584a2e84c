#pragma once

#include <future>
#include <utility>

namespace pepeseg {

// Does pieces of work one after the other on another thread, in the order of the calls, at most one
// piece behind the caller: for host work on what a device has made, while the device makes more.
class Behind {
 public:
  Behind() = default;
  ~Behind() { Wait(); }
  Behind(const Behind&) = delete;
  Behind& operator=(const Behind&) = delete;

  // Waits for the piece before, then starts this one. What it refers to must outlive Wait.
  template <class Work>
  void Do(Work&& work) {
    Wait();
    running_ = std::async(std::launch::async, std::forward<Work>(work));
  }
  // Waits for the last piece.
  void Wait() {
    if (running_.valid()) running_.get();
  }

 private:
  std::future<void> running_;
};

}  // namespace pepeseg
