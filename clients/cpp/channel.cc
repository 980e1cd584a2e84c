#include "clients/cpp/channel.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/client_interceptor.h>

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/proxy.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client {
namespace {

constexpr int kMaxAnswerBytes = 64 << 20;  // gRPC's default is 4 MiB
constexpr char kHttps[] = "https://", kHttp[] = "http://";

// Unprintable characters are refused here: gRPC would end the call with an error that does not name
// the key.
bool IsKey(const std::string& text) {
  return text.rfind("pk_", 0) == 0 && std::all_of(text.begin(), text.end(), absl::ascii_isgraph);
}

bool IsJwt(const std::string& text) {
  const auto is_allowed = [](char c) {
    return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' || c == '.';
  };
  // Header, claims and signature in base64url, each of which must not be empty.
  return std::count(text.begin(), text.end(), '.') == 2 && text.front() != '.' &&
         text.back() != '.' && text.find("..") == std::string::npos &&
         std::all_of(text.begin(), text.end(), is_allowed);
}

// Returns the key or token of `login` or of PEPESEG_KEY; "" if there is none. INVALID_ARGUMENT: the
// text is neither.
absl::StatusOr<std::string> FindKey(const Login& login) {
  std::string from = "PEPESEG_KEY";
  std::string text;
  if (!login.key_file.empty()) {
    from = login.key_file;
    ASSIGN_OR_RETURN(text, ReadFile(login.key_file));
    // Only the first line counts.
    text = text.substr(0, text.find('\n'));
  } else if (const char* value = std::getenv("PEPESEG_KEY")) {
    text = value;
  }
  const std::string key(absl::StripAsciiWhitespace(text));
  // An empty variable means no key; an empty file is an error below.
  if (key.empty() && login.key_file.empty()) return key;
  if (!IsKey(key) && !IsJwt(key)) {
    return absl::InvalidArgumentError(
        absl::StrCat(from,
                     ": holds neither an API key (a line that begins with pk_) nor a token (JWT: "
                     "three parts separated by '.')"));
  }
  return key;
}

absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> TlsCredentials(const Login& login) {
  if (login.certificate.empty() != login.certificate_key.empty()) {
    return absl::InvalidArgumentError("--certificate and --certificate-key must be given together");
  }
  grpc::SslCredentialsOptions options;
  if (!login.ca.empty()) {
    ASSIGN_OR_RETURN(options.pem_root_certs, ReadFile(login.ca));
  }
  if (!login.certificate.empty()) {
    ASSIGN_OR_RETURN(options.pem_cert_chain, ReadFile(login.certificate));
    ASSIGN_OR_RETURN(options.pem_private_key, ReadFile(login.certificate_key));
  }
  return grpc::SslCredentials(options);
}

using grpc::experimental::ClientInterceptorFactoryInterface;
using grpc::experimental::ClientRpcInfo;
using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::Interceptor;
using grpc::experimental::InterceptorBatchMethods;

// Adds the key to the metadata of each call. gRPC's own call credentials are not used: it refuses
// to send them over a loopback connection without TLS.
class KeyInterceptor final : public Interceptor {
 public:
  explicit KeyInterceptor(const std::string& header) : header_(header) {}
  void Intercept(InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      methods->GetSendInitialMetadata()->emplace("authorization", header_);
    }
    methods->Proceed();
  }

 private:
  const std::string& header_;  // of the factory, which the channel keeps alive
};

class KeyInterceptorFactory final : public ClientInterceptorFactoryInterface {
 public:
  explicit KeyInterceptorFactory(const std::string& key) : header_(absl::StrCat("Bearer ", key)) {}
  Interceptor* CreateClientInterceptor(ClientRpcInfo*) override {
    return new KeyInterceptor(header_);  // gRPC deletes it
  }

 private:
  const std::string header_;
};

// Names the proxy in the status of a call that failed at it: gRPC's message has only an address.
class ProxyInterceptor final : public Interceptor {
 public:
  ProxyInterceptor(const Proxy& proxy, const std::string& target)
      : proxy_(proxy), target_(target) {}
  void Intercept(InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::POST_RECV_STATUS)) {
      grpc::Status* status = methods->GetRecvStatus();
      if (status->error_code() == grpc::StatusCode::UNAVAILABLE) {
        const std::string message = ExplainProxyFailure(proxy_, target_, status->error_message());
        if (!message.empty()) *status = grpc::Status(grpc::StatusCode::UNAVAILABLE, message);
      }
    }
    methods->Proceed();
  }

 private:
  const Proxy& proxy_;  // of the factory, which the channel keeps alive, as is `target_`
  const std::string& target_;
};

class ProxyInterceptorFactory final : public ClientInterceptorFactoryInterface {
 public:
  ProxyInterceptorFactory(Proxy proxy, std::string target)
      : proxy_(std::move(proxy)), target_(std::move(target)) {}
  Interceptor* CreateClientInterceptor(ClientRpcInfo*) override {
    return new ProxyInterceptor(proxy_, target_);  // gRPC deletes it
  }

 private:
  const Proxy proxy_;
  const std::string target_;
};

}  // namespace

bool IsThisMachine(const std::string& server) {
  if (server.rfind("unix:", 0) == 0) return true;
  const std::string host = server.substr(0, server.rfind(':'));
  if (host == "localhost" || host == "[::1]") return true;
  // All of 127.0.0.0/8, but not a name such as 127.0.0.1.example.org.
  return host.rfind("127.", 0) == 0 && host.find_first_not_of("0123456789.") == std::string::npos;
}

absl::StatusOr<std::shared_ptr<grpc::Channel>> OpenChannel(const std::string& server,
                                                           const Login& login) {
  const bool is_https = server.rfind(kHttps, 0) == 0;
  const bool is_http = server.rfind(kHttp, 0) == 0;
  const std::string target = is_https  ? server.substr(sizeof(kHttps) - 1)
                             : is_http ? server.substr(sizeof(kHttp) - 1)
                                       : server;
  const bool tls = login.tls || is_https || !login.ca.empty() || !login.certificate.empty() ||
                   !login.certificate_key.empty();
  if (is_http && tls) {
    return absl::InvalidArgumentError(
        absl::StrCat(server, " is not encrypted, but --tls or a certificate asks for TLS"));
  }
  ASSIGN_OR_RETURN(const std::string key, FindKey(login));
  // The key is as good as a password: it never leaves this machine unencrypted.
  if (!key.empty() && !tls && !IsThisMachine(target)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the key is not sent to ", target,
        ": the connection is not encrypted, so that others on the network could read and use it; "
        "connect over TLS with --tls or --ca FILE"));
  }
  std::shared_ptr<grpc::ChannelCredentials> credentials = grpc::InsecureChannelCredentials();
  if (tls) {
    ASSIGN_OR_RETURN(credentials, TlsCredentials(login));
  }
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMaxAnswerBytes);
  std::vector<std::unique_ptr<ClientInterceptorFactoryInterface>> interceptors;
  if (std::optional<Proxy> proxy = ProxyOf(target)) {
    interceptors.push_back(std::make_unique<ProxyInterceptorFactory>(*std::move(proxy), target));
  } else {
    arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  }
  if (!key.empty()) interceptors.push_back(std::make_unique<KeyInterceptorFactory>(key));
  return grpc::experimental::CreateCustomChannelWithInterceptors(target, credentials, arguments,
                                                                 std::move(interceptors));
}

}  // namespace pepeseg::client
