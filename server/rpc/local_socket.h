#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <thread>

#include "absl/status/statusor.h"
#include "core/base/beneath_folder.h"

namespace pepeseg {

// A listening Unix socket for this user alone: its file has mode 0600 from its first moment, and
// the kernel is asked who connects (SO_PEERCRED): others than this user and root are turned away,
// should the file's mode have been changed. It is no way for a worker: its sandbox lets it connect
// to nothing.
class LocalSocket {
 public:
  // Makes the folder of `path`, of mode 0700, where there is none. FAILED_PRECONDITION: others may
  // write to the folder of `path` (as to /tmp), and so put a socket
  // of theirs in its place. UNAVAILABLE: somebody listens there. A socket left by a process that is
  // gone is replaced.
  static absl::StatusOr<std::unique_ptr<LocalSocket>> Listen(const std::filesystem::path& path);
  ~LocalSocket();  // Stop()
  LocalSocket(const LocalSocket&) = delete;
  LocalSocket& operator=(const LocalSocket&) = delete;

  // From now on calls `take`, from a thread of its own, with each connection: it closes it. Once.
  void Serve(std::function<void(int connection)> take);
  // Takes no more connections, and removes the file.
  void Stop();

 private:
  LocalSocket(std::filesystem::path path, Descriptor listener, Descriptor stop);
  void AcceptUntilStopped(const std::function<void(int connection)>& take);

  const std::filesystem::path path_;
  Descriptor listener_;
  const Descriptor stop_;  // readable: time to stop
  std::thread thread_;
};

}  // namespace pepeseg
