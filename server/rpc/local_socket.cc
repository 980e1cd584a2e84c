#include "server/rpc/local_socket.h"

#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr mode_t kMode = S_IRUSR | S_IWUSR;
constexpr int kBacklog = 64;

absl::Status SystemError(const std::filesystem::path& path, absl::string_view what) {
  return absl::UnavailableError(
      absl::StrCat(path.string(), ": ", what, ": ", std::generic_category().message(errno)));
}

absl::StatusOr<sockaddr_un> AddressOf(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string name = path.string();
  if (name.empty() || name.size() >= sizeof(address.sun_path)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "'", name, "': a path of 1 to ", sizeof(address.sun_path) - 1, " bytes is wanted"));
  }
  name.copy(address.sun_path, name.size());
  return address;
}

absl::Status MakeFolder(const std::filesystem::path& path) {
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  struct stat what {};
  if (mkdir(folder.c_str(), S_IRWXU) != 0 && errno != EEXIST) return SystemError(folder, "make");
  if (stat(folder.c_str(), &what) != 0) return SystemError(folder, "look at");
  // Who may write to the folder could replace the socket by one of their own. mkdir above made it
  // 0700 if there was none.
  if ((what.st_mode & S_IWOTH) == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat(path.string(), ": everybody may write to ", folder.string(),
                   ": put the socket in a folder of this user's, as /run/pepeseg"));
}

// Removes a socket at which no process listens.
absl::Status RemoveDead(const std::filesystem::path& path, const sockaddr_un& address) {
  struct stat what {};
  if (lstat(path.c_str(), &what) != 0) return absl::OkStatus();
  const Descriptor caller(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  // A socket at which nobody listens refuses the connection: its process was killed.
  const bool answers =
      connect(caller.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  if (answers || !S_ISSOCK(what.st_mode)) {
    return absl::UnavailableError(absl::StrCat(path.string(), ": is taken"));
  }
  unlink(path.c_str());
  return absl::OkStatus();
}

bool IsOfThisUserOrRoot(int connection) {
  ucred peer{};
  socklen_t size = sizeof(peer);
  if (getsockopt(connection, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return false;
  if (peer.uid == geteuid() || peer.uid == 0) return true;
  spdlog::warn("admin socket: process {} of user {} was turned away", peer.pid, peer.uid);
  return false;
}

}  // namespace

LocalSocket::LocalSocket(std::filesystem::path path, Descriptor listener, Descriptor stop)
    : path_(std::move(path)), listener_(std::move(listener)), stop_(std::move(stop)) {}

LocalSocket::~LocalSocket() { Stop(); }

absl::StatusOr<std::unique_ptr<LocalSocket>> LocalSocket::Listen(
    const std::filesystem::path& path) {
  RETURN_IF_ERROR(MakeFolder(path));
  ASSIGN_OR_RETURN(const sockaddr_un address, AddressOf(path));
  RETURN_IF_ERROR(RemoveDead(path, address));
  Descriptor listener(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  Descriptor stop(eventfd(0, EFD_CLOEXEC));
  if (listener.get() < 0 || stop.get() < 0) return SystemError(path, "make");
  // Set before bind(), which gives the file the mode of the socket.
  if (fchmod(listener.get(), kMode) != 0) return SystemError(path, "protect");
  if (bind(listener.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 ||
      listen(listener.get(), kBacklog) != 0) {
    return SystemError(path, "listen");
  }
  return std::unique_ptr<LocalSocket>(new LocalSocket(path, std::move(listener), std::move(stop)));
}

void LocalSocket::Serve(std::function<void(int connection)> take) {
  thread_ = std::thread([this, take = std::move(take)] { AcceptUntilStopped(take); });
}

void LocalSocket::AcceptUntilStopped(const std::function<void(int connection)>& take) {
  pollfd ends[] = {{listener_.get(), POLLIN, 0}, {stop_.get(), POLLIN, 0}};
  while (true) {
    if (poll(ends, 2, -1) < 0 && errno != EINTR) return;
    if (ends[1].revents != 0) return;
    // Nonblocking, since a client may have gone between poll() and here.
    const int connection = accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (connection >= 0 && IsOfThisUserOrRoot(connection)) {
      take(connection);
    } else if (connection >= 0) {
      close(connection);
    } else if (errno != EAGAIN && errno != EINTR && errno != ECONNABORTED) {
      // No descriptor is free; one may become free soon.
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  }
}

void LocalSocket::Stop() {
  if (listener_.get() < 0) return;
  const uint64_t one = 1;
  while (write(stop_.get(), &one, sizeof(one)) < 0 && errno == EINTR) {
  }
  if (thread_.joinable()) thread_.join();
  listener_ = Descriptor();
  unlink(path_.c_str());
}

}  // namespace pepeseg
