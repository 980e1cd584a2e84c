#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <thread>

#include "absl/status/statusor.h"
#include "server/worker_protocol/beneath_folder.h"

namespace pepeseg {

// A Unix socket that only this user and root can connect to. Its file has mode 0600 from the start.
// In case somebody changes the mode, the peer's user is checked, too (SO_PEERCRED). A worker cannot
// use it: the sandbox does not let it connect.
class LocalSocket {
 public:
  // Listens at `path`. Creates its folder with mode 0700 if there is none, and replaces the socket
  // of a process that is gone. FAILED_PRECONDITION: others may write to the folder, such as /tmp,
  // and could put a socket of theirs there. UNAVAILABLE: another process listens there.
  static absl::StatusOr<std::unique_ptr<LocalSocket>> Listen(const std::filesystem::path& path);
  ~LocalSocket();  // calls Stop()
  LocalSocket(const LocalSocket&) = delete;
  LocalSocket& operator=(const LocalSocket&) = delete;

  // Starts a thread that calls `take` with each connection, which `take` must close. Call once.
  void Serve(std::function<void(int connection)> take);
  // Stops to accept connections and removes the file.
  void Stop();

 private:
  LocalSocket(std::filesystem::path path, Descriptor listener, Descriptor stop);
  void AcceptUntilStopped(const std::function<void(int connection)>& take);

  const std::filesystem::path path_;
  Descriptor listener_;
  const Descriptor stop_;  // becomes readable when the thread must stop
  std::thread thread_;
};

}  // namespace pepeseg
