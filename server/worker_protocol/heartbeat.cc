#include "server/worker_protocol/heartbeat.h"

#include <fcntl.h>
#include <pthread.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>

namespace pepeseg {

bool Touch(const std::filesystem::path& path) {
  // The file usually exists: one call, and no descriptor, which may be short.
  if (utimensat(AT_FDCWD, path.c_str(), nullptr, 0) == 0) return true;
  const int descriptor = open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
  if (descriptor < 0) return false;
  const bool touched = futimens(descriptor, nullptr) == 0;
  close(descriptor);
  return touched;
}

// The byte is always the same one, so that a full disk does not matter.
bool Beat(const std::filesystem::path& path) {
  const int descriptor = open(path.c_str(), O_WRONLY | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644);
  if (descriptor < 0) return false;
  const bool written = pwrite(descriptor, "\n", 1, 0) == 1;
  close(descriptor);
  return written;
}

void HeartbeatWatch::Expect() {
  seen_ = true;
  change_ = std::chrono::steady_clock::now();
}

std::chrono::steady_clock::duration HeartbeatWatch::SinceChange() {
  const auto now = std::chrono::steady_clock::now();
  struct stat status {};
  if (lstat(path_.c_str(), &status) == 0) {
    const timespec& time = status.st_mtim;
    if (!seen_ || time.tv_sec != newest_.tv_sec || time.tv_nsec != newest_.tv_nsec) change_ = now;
    seen_ = true;
    newest_ = time;
  }
  return seen_ ? now - change_ : std::chrono::steady_clock::duration::zero();
}

WorkerHeartbeat::WorkerHeartbeat(const std::filesystem::path& heartbeat,
                                 const std::filesystem::path& lease, std::chrono::seconds length,
                                 std::function<void()> lost)
    : heartbeat_(heartbeat), length_(length), lost_(std::move(lost)), lease_(lease) {
  // The new thread inherits this mask, so that the kernel delivers SIGTERM to the thread that
  // trains.
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, &before);
  thread_ = std::thread([this] { Run(); });
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

WorkerHeartbeat::~WorkerHeartbeat() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stop_.notify_all();
  thread_.join();
}

void WorkerHeartbeat::Run() {
  using std::chrono::milliseconds;
  // At least fourteen looks at the lease's file before it counts as lost.
  milliseconds period(1000);
  if (length_.count() > 0) period = std::min(period, milliseconds(length_) / 20);
  std::unique_lock lock(mutex_);
  do {
    Beat(heartbeat_);
    if (length_.count() > 0 && lease_.SinceChange() > milliseconds(length_) * 7 / 10) lost_();
  } while (!stop_.wait_for(lock, period, [this] { return stopping_; }));
}

}  // namespace pepeseg
