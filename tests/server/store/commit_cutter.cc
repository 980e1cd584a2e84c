#include "tests/server/store/commit_cutter.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstring>

namespace pepeseg::testing {
namespace {

constexpr int kLookMilliseconds = 50;  // interval at which threads check whether to stop
constexpr size_t kLengthBytes = 4;

sockaddr_un AddressOf(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  EXPECT_LT(path.string().size(), sizeof(address.sun_path));
  std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
  return address;
}

bool SendAll(int to, const std::string& bytes) {
  for (size_t sent = 0; sent < bytes.size();) {
    const ssize_t put = send(to, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (put <= 0) return false;
    sent += static_cast<size_t>(put);
  }
  return true;
}

// Returns the bytes that have arrived; none: the connection is closed.
std::string Receive(int from) {
  std::array<char, 1 << 16> block{};
  const ssize_t got = recv(from, block.data(), block.size(), 0);
  return {block.data(), got > 0 ? static_cast<size_t>(got) : 0};
}

// Returns the size of the message at the start of `pending`, or 0 if it is not complete. In
// PostgreSQL's protocol every message but the first of a connection begins with a byte for its
// type, before its length.
size_t MessageBytes(const std::string& pending, bool started) {
  const size_t type = started ? 1 : 0;
  if (pending.size() < type + kLengthBytes) return 0;
  uint32_t length = 0;
  std::memcpy(&length, pending.data() + type, kLengthBytes);
  const size_t size = type + ntohl(length);
  return pending.size() < size ? 0 : size;
}

// Returns whether a message is a COMMIT: a simple query (Q, then its text) or one to be parsed (P,
// then a name and the text).
bool IsCommit(const std::string& message) {
  if (message.size() <= 1 + kLengthBytes) return false;
  std::string text = message.substr(1 + kLengthBytes);
  if (message[0] == 'P') text.erase(0, text.find('\0') + 1);
  return (message[0] == 'Q' || message[0] == 'P') && text.starts_with("COMMIT");
}

// Reads from the server until it reports that it is ready for the next query. The client does not
// get these bytes.
void AwaitReady(int server) {
  std::string pending;
  while (true) {
    for (size_t size = 0; (size = MessageBytes(pending, true)) > 0; pending.erase(0, size)) {
      if (pending[0] == 'Z') return;
    }
    const std::string more = Receive(server);
    if (more.empty()) return;
    pending += more;
  }
}

}  // namespace

CommitCutter::CommitCutter(std::filesystem::path socket) : socket_(std::move(socket)) {
  listener_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_un address = AddressOf(folder_ / socket_.filename());
  EXPECT_EQ(bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  EXPECT_EQ(listen(listener_, 64), 0);
  acceptor_ = std::thread([this] { Accept(); });
}

CommitCutter::~CommitCutter() {
  stopping_ = true;
  acceptor_.join();
  for (std::thread& connection : connections_) connection.join();
  close(listener_);
}

void CommitCutter::Arm(int64_t number, Cut cut) {
  armed_ = 0;
  num_commits_ = 0;
  has_cut_ = false;
  cut_ = cut;
  armed_ = number;
}

void CommitCutter::Accept() {
  while (!stopping_) {
    pollfd wait{listener_, POLLIN, 0};
    if (poll(&wait, 1, kLookMilliseconds) <= 0) continue;
    Pair pair;
    pair.client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    pair.server = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_un address = AddressOf(socket_);
    if (connect(pair.server, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
      close(pair.client);
      close(pair.server);
      continue;
    }
    const std::lock_guard lock(mutex_);
    connections_.emplace_back([this, pair] { Serve(pair); });
  }
}

void CommitCutter::Serve(Pair pair) {
  std::string pending;   // bytes of the client that are not a whole message yet
  bool started = false;  // the client's start-up message was forwarded
  for (bool open = true; open && !stopping_;) {
    std::array<pollfd, 2> wait = {pollfd{pair.client, POLLIN, 0}, pollfd{pair.server, POLLIN, 0}};
    if (poll(wait.data(), wait.size(), kLookMilliseconds) <= 0) continue;
    if (wait[1].revents != 0) {
      const std::string bytes = Receive(pair.server);
      open = !bytes.empty() && SendAll(pair.client, bytes);
    }
    if (open && wait[0].revents != 0) open = Forward(pair, pending, started);
  }
  close(pair.client);
  close(pair.server);
}

bool CommitCutter::Forward(const Pair& pair, std::string& pending, bool& started) {
  const std::string bytes = Receive(pair.client);
  if (bytes.empty()) return false;
  pending += bytes;
  while (const size_t size = MessageBytes(pending, started)) {
    const std::string message = pending.substr(0, size);
    pending.erase(0, size);
    const bool is_commit = started && IsCommit(message);
    const bool hit = is_commit && ++num_commits_ == armed_;
    if (hit) has_cut_ = true;
    if (hit && cut_ == Cut::kBefore) return false;
    if (!SendAll(pair.server, message)) return false;
    if (hit) {
      // If the query was sent as Parse, the messages that execute it follow.
      if (!SendAll(pair.server, pending)) return false;
      AwaitReady(pair.server);
      return false;
    }
    started = true;
  }
  return true;
}

}  // namespace pepeseg::testing
