#pragma once

#include <openssl/ssl.h>

#include <cstdint>
#include <memory>
#include <string>

// Writes HTTP/2 frames by hand, to send what no gRPC client sends.
namespace pepeseg::http2 {

inline constexpr char kPreface[] = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

enum FrameType : uint8_t { kHeaders = 1, kReset = 3, kSettings = 4, kPing = 6, kContinuation = 9 };
enum Flags : uint8_t { kNone = 0, kEndHeaders = 4 };

std::string Frame(FrameType type, uint8_t flags, uint32_t stream, const std::string& payload);
// Returns an HPACK literal without indexing. Name and value have at most 126 bytes each.
std::string Header(const std::string& name, const std::string& value);
// Returns the headers of a call of ListScenes.
std::string CallHeaders();

// A connection to a port of this machine.
class Connection {
 public:
  enum class Kind { kPlain, kTls };
  explicit Connection(int port, Kind kind = Kind::kPlain);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // Sends bytes. Returns false if the server has closed the connection, or takes no more.
  bool Send(const std::string& bytes);
  // Returns whether the connection is open. Drops what the server has sent.
  bool IsOpen();

 private:
  struct Free {
    void operator()(SSL* tls) const { SSL_free(tls); }
  };
  bool StartTls();
  // Like send(2) and recv(2): -1 and EAGAIN if the call would block.
  ssize_t Write(const char* bytes, size_t size);
  ssize_t Read(char* bytes, size_t size);
  // Reads and drops the server's answers.
  void Drop();

  const int socket_;
  std::unique_ptr<SSL, Free> tls_;
  bool open_ = false;
  int num_refused_ = 0;
};

}  // namespace pepeseg::http2
