#include "server/rpc/listener_probe.h"

#include <netinet/in.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr int kMaxFrames = 64;  // before the answer: settings, window updates, pings
constexpr size_t kFrameHeaderBytes = 9;

absl::Status Failed(absl::string_view step) {
  // EAGAIN and EINPROGRESS mean that the socket's timeout has passed.
  const int error = errno;
  return absl::UnavailableError(absl::StrCat(
      step, ": ", error == EAGAIN || error == EINPROGRESS ? "no answer" : strerror(error)));
}

struct FreeTls {
  void operator()(SSL_CTX* context) const { SSL_CTX_free(context); }
  void operator()(SSL* tls) const { SSL_free(tls); }
  void operator()(BIO* bio) const { BIO_free(bio); }
  void operator()(X509* certificate) const { X509_free(certificate); }
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
};
template <typename T>
using TlsPtr = std::unique_ptr<T, FreeTls>;

// A new connection to `address`. The destructor closes it.
class ProbeConnection {
 public:
  ProbeConnection() = default;
  ~ProbeConnection() {
    // Before the descriptor is closed, which OpenSSL has but does not own.
    tls_.reset();
    if (socket_ >= 0) close(socket_);
  }
  ProbeConnection(const ProbeConnection&) = delete;
  ProbeConnection& operator=(const ProbeConnection&) = delete;

  absl::Status Connect(const ListenerProbeOptions& options);
  absl::Status StartTls(const CertificateTexts& certificate);
  bool has_tls() const { return tls_ != nullptr; }
  // Returns whether the server has shown its certificate, asks clients for one, and has closed the
  // connection instead of not answering.
  bool WasRefused() const { return asks_certificate_ && saw_certificate_ && hung_up_; }
  absl::Status Write(absl::string_view bytes);
  absl::Status Read(char* bytes, size_t size);  // all of `size`

 private:
  // Call right after the call of OpenSSL that returned `result`.
  absl::Status TlsFailed(absl::string_view step, int result);

  int socket_ = -1;
  TlsPtr<SSL_CTX> tls_context_;
  TlsPtr<SSL> tls_;
  bool asks_certificate_ = false;
  bool saw_certificate_ = false;
  bool hung_up_ = false;
};

// Returns the address to connect to: that of the listening socket, or loopback for a wildcard.
void MakeReachable(sockaddr_storage& address) {
  if (address.ss_family == AF_INET) {
    auto& in = reinterpret_cast<sockaddr_in&>(address);
    if (in.sin_addr.s_addr == htonl(INADDR_ANY)) in.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  } else if (address.ss_family == AF_INET6) {
    auto& in6 = reinterpret_cast<sockaddr_in6&>(address);
    if (IN6_IS_ADDR_UNSPECIFIED(&in6.sin6_addr)) in6.sin6_addr = in6addr_loopback;
  }
}

// Binds to a free port of any address, so that the port is known before the connection is made.
absl::StatusOr<int> BindLocally(int socket, sa_family_t family) {
  if (family == AF_UNIX) return 0;
  sockaddr_storage local{};
  local.ss_family = family;
  socklen_t size = family == AF_INET ? sizeof(sockaddr_in) : sizeof(sockaddr_in6);
  auto* address = reinterpret_cast<sockaddr*>(&local);
  if (bind(socket, address, size) != 0 || getsockname(socket, address, &size) != 0) {
    return Failed("bind");
  }
  return ntohs(family == AF_INET ? reinterpret_cast<sockaddr_in&>(local).sin_port
                                 : reinterpret_cast<sockaddr_in6&>(local).sin6_port);
}

absl::Status ProbeConnection::Connect(const ListenerProbeOptions& options) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  if (getsockname(options.listening, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    return Failed("getsockname");
  }
  MakeReachable(address);
  socket_ = socket(address.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (socket_ < 0) return Failed("socket");
  const timeval timeout = absl::ToTimeval(options.timeout);
  // The timeouts also bound connect(), so that no step blocks for ever.
  setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof(timeout));
  setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &timeout, sizeof(timeout));
  ASSIGN_OR_RETURN(const int port, BindLocally(socket_, address.ss_family));
  options.on_port(port);
  if (connect(socket_, reinterpret_cast<sockaddr*>(&address), size) != 0) return Failed("connect");
  return absl::OkStatus();
}

template <typename T, typename ReadPem>
TlsPtr<T> ReadOne(const std::string& text, ReadPem read) {
  const TlsPtr<BIO> bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  return TlsPtr<T>(read(bio.get(), nullptr, nullptr, nullptr));
}

absl::Status ProbeConnection::StartTls(const CertificateTexts& certificate) {
  constexpr unsigned char kHttp2[] = {2, 'h', '2'};
  asks_certificate_ = !certificate.client_ca.empty();
  tls_context_.reset(SSL_CTX_new(TLS_client_method()));
  const auto leaf = ReadOne<X509>(certificate.chain, PEM_read_bio_X509);
  const auto key = ReadOne<EVP_PKEY>(certificate.key, PEM_read_bio_PrivateKey);
  // A listener that verifies clients may not accept the server's own certificate; WasRefused()
  // knows that case. The listener's certificate is not verified: only an answer is wanted.
  if (tls_context_ != nullptr && leaf != nullptr && key != nullptr) {
    SSL_CTX_use_certificate(tls_context_.get(), leaf.get());
    SSL_CTX_use_PrivateKey(tls_context_.get(), key.get());
  }
  tls_.reset(tls_context_ == nullptr ? nullptr : SSL_new(tls_context_.get()));
  if (tls_ == nullptr || SSL_set_fd(tls_.get(), socket_) != 1) {
    return absl::UnavailableError("TLS cannot be set up");
  }
  SSL_set_alpn_protos(tls_.get(), kHttp2, sizeof(kHttp2));
  const int result = SSL_connect(tls_.get());
  saw_certificate_ = SSL_get0_peer_certificate(tls_.get()) != nullptr;
  return result == 1 ? absl::OkStatus() : TlsFailed("TLS handshake", result);
}

absl::Status ProbeConnection::TlsFailed(absl::string_view step, int result) {
  // Read errno before any call of OpenSSL, which may change it.
  const bool timed_out = errno == EAGAIN;
  const int error = SSL_get_error(tls_.get(), result);
  hung_up_ = error == SSL_ERROR_ZERO_RETURN || error == SSL_ERROR_SSL ||
             (error == SSL_ERROR_SYSCALL && !timed_out);
  ERR_clear_error();  // the error queue belongs to this thread
  return absl::UnavailableError(absl::StrCat(step, ": ", hung_up_ ? "hung up" : "no answer"));
}

absl::Status ProbeConnection::Write(absl::string_view bytes) {
  errno = 0;
  if (tls_ != nullptr) {
    const int result = SSL_write(tls_.get(), bytes.data(), static_cast<int>(bytes.size()));
    return result > 0 ? absl::OkStatus() : TlsFailed("write", result);
  }
  const ssize_t sent = send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  return sent == static_cast<ssize_t>(bytes.size()) ? absl::OkStatus() : Failed("write");
}

absl::Status ProbeConnection::Read(char* bytes, size_t size) {
  while (size > 0) {
    errno = 0;
    const ssize_t got = tls_ != nullptr ? SSL_read(tls_.get(), bytes, static_cast<int>(size))
                                        : recv(socket_, bytes, size, 0);
    if (got <= 0 && tls_ != nullptr) return TlsFailed("read", static_cast<int>(got));
    if (got == 0) return absl::UnavailableError("read: the server hung up");
    if (got < 0) return Failed("read");
    bytes += got;
    size -= static_cast<size_t>(got);
  }
  return absl::OkStatus();
}

// Types of HTTP/2 frames.
enum FrameKind : uint8_t { kData = 0, kHeaders = 1, kReset = 3, kSettings = 4, kGoAway = 7 };

void AppendFrame(std::string& to, FrameKind kind, char flags, char stream,
                 absl::string_view payload) {
  const char header[kFrameHeaderBytes] = {
      0, 0, static_cast<char>(payload.size()), static_cast<char>(kind), flags, 0, 0, 0, stream};
  to.append(header, sizeof(header));
  absl::StrAppend(&to, payload);
}

// Appends an HPACK header: the name is at `index` of the static table, the value has at most 126
// bytes.
void AppendHeader(std::string& to, absl::string_view index, absl::string_view value) {
  absl::StrAppend(&to, index, std::string(1, static_cast<char>(value.size())), value);
}

// Returns a request for grpc.health.v1.Health/Check of the whole server, whose message is empty.
std::string HealthCall(bool has_tls) {
  constexpr char kEndStream = 1, kEndHeaders = 4, kStream = 1;
  // The headers by HPACK (RFC 7541) without Huffman codes or a dynamic table, so that each call has
  // the same bytes. 0x80 + index: a whole entry of the static table.
  std::string headers = "\x83";          // :method POST
  headers += has_tls ? "\x87" : "\x86";  // :scheme
  AppendHeader(headers, "\x04", "/grpc.health.v1.Health/Check");
  AppendHeader(headers, "\x01", "localhost");  // :authority
  AppendHeader(headers, "\x0f\x10", "application/grpc");
  AppendHeader(headers, absl::string_view("\0\2te", 4), "trailers");
  std::string call = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
  AppendFrame(call, kSettings, 0, 0, "");
  AppendFrame(call, kHeaders, kEndHeaders, kStream, headers);
  AppendFrame(call, kData, kEndStream, kStream, absl::string_view("\0\0\0\0\0", 5));
  return call;
}

absl::Status AwaitAnswer(ProbeConnection& connection) {
  for (int i = 0; i < kMaxFrames; ++i) {
    unsigned char header[kFrameHeaderBytes];
    RETURN_IF_ERROR(connection.Read(reinterpret_cast<char*>(header), sizeof(header)));
    // Headers are an answer, whatever status they hold: the listener and gRPC's threads are alive.
    if (header[3] == kHeaders) return absl::OkStatus();
    if (header[3] == kReset || header[3] == kGoAway) {
      return absl::UnavailableError("the server ended the call without an answer");
    }
    // The first three bytes of a frame are the length of its payload, which is skipped.
    std::string payload(static_cast<size_t>(header[0] << 16 | header[1] << 8 | header[2]), '\0');
    RETURN_IF_ERROR(connection.Read(payload.data(), payload.size()));
  }
  return absl::UnavailableError("the server sends frames but no answer");
}

absl::Status Ask(const ListenerProbeOptions& options, ProbeConnection& connection) {
  RETURN_IF_ERROR(connection.Connect(options));
  if (options.certificate) {
    const std::optional<CertificateTexts> texts = options.certificate();
    if (texts) RETURN_IF_ERROR(connection.StartTls(*texts));
  }
  RETURN_IF_ERROR(connection.Write(HealthCall(connection.has_tls())));
  return AwaitAnswer(connection);
}

}  // namespace

absl::Status ProbeListener(const ListenerProbeOptions& options) {
  ProbeConnection connection;
  const absl::Status status = Ask(options, connection);
  return connection.WasRefused() ? absl::OkStatus() : status;
}

}  // namespace pepeseg
