#include "tests/system/stress/http2_connection.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>

namespace pepeseg::http2 {
namespace {

// Does not verify the server: these tests do not depend on its identity.
SSL* NewTls() {
  static SSL_CTX* const context = SSL_CTX_new(TLS_client_method());
  SSL* tls = SSL_new(context);
  SSL_set_alpn_protos(tls, reinterpret_cast<const unsigned char*>("\x02h2"), 3);
  SSL_set_mode(tls, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
  return tls;
}

// Converts OpenSSL's result to that of a system call.
ssize_t AsOfSocket(SSL* tls, int result) {
  if (result > 0) return result;
  const int error = SSL_get_error(tls, result);
  if (error == SSL_ERROR_ZERO_RETURN) return 0;
  errno = error == SSL_ERROR_WANT_READ || error == SSL_ERROR_WANT_WRITE ? EAGAIN : EPIPE;
  return -1;
}

}  // namespace

std::string Frame(FrameType type, uint8_t flags, uint32_t stream, const std::string& payload) {
  std::string frame;
  for (int shift = 16; shift >= 0; shift -= 8) frame += static_cast<char>(payload.size() >> shift);
  frame += static_cast<char>(type);
  frame += static_cast<char>(flags);
  for (int shift = 24; shift >= 0; shift -= 8) frame += static_cast<char>(stream >> shift);
  return frame + payload;
}

std::string Header(const std::string& name, const std::string& value) {
  std::string header(1, '\0');
  header += static_cast<char>(name.size());
  header += name;
  header += static_cast<char>(value.size());
  return header + value;
}

std::string CallHeaders() {
  return Header(":method", "POST") + Header(":scheme", "http") +
         Header(":path", "/pepeseg.v1.SceneService/ListScenes") + Header(":authority", "here") +
         Header("te", "trailers") + Header("content-type", "application/grpc");
}

Connection::Connection(int port, Kind kind)
    : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  open_ = connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0;
  if (kind == Kind::kTls) open_ = open_ && StartTls();
}

Connection::~Connection() {
  tls_.reset();
  close(socket_);
}

bool Connection::StartTls() {
  std::signal(SIGPIPE, SIG_IGN);  // OpenSSL writes without MSG_NOSIGNAL
  tls_.reset(NewTls());
  SSL_set_fd(tls_.get(), socket_);
  if (SSL_connect(tls_.get()) != 1) return false;
  return fcntl(socket_, F_SETFL, O_NONBLOCK) == 0;
}

ssize_t Connection::Write(const char* bytes, size_t size) {
  if (tls_ == nullptr) return send(socket_, bytes, size, MSG_NOSIGNAL | MSG_DONTWAIT);
  return AsOfSocket(tls_.get(), SSL_write(tls_.get(), bytes, static_cast<int>(size)));
}

ssize_t Connection::Read(char* bytes, size_t size) {
  if (tls_ == nullptr) return recv(socket_, bytes, size, MSG_DONTWAIT);
  return AsOfSocket(tls_.get(), SSL_read(tls_.get(), bytes, static_cast<int>(size)));
}

void Connection::Drop() {
  char bytes[4096];
  while (open_) {
    const ssize_t size = Read(bytes, sizeof(bytes));
    if (size > 0) continue;
    if (size == 0 || errno != EAGAIN) open_ = false;
    return;
  }
}

bool Connection::IsOpen() {
  Drop();
  return open_;
}

bool Connection::Send(const std::string& bytes) {
  size_t sent = 0;
  while (open_ && sent < bytes.size()) {
    Drop();
    if (!open_) break;
    const ssize_t size = Write(bytes.data() + sent, bytes.size() - sent);
    if (size > 0) sent += static_cast<size_t>(size);
    if (size < 0 && errno != EAGAIN) open_ = false;
    if (size < 0 && ++num_refused_ > 2000) open_ = false;
    if (size < 0 && open_) usleep(1000);
  }
  return open_;
}

}  // namespace pepeseg::http2
