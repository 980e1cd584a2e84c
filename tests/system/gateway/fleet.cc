#include "tests/system/gateway/fleet.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/access/api_key.h"
#include "server/store/layout.h"
#include "server/store/store.h"
#include "tests/testing/http_get.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::testing {
namespace {

constexpr char kLuaossl[] = "/usr/share/lua/5.3/openssl/pkey.lua";
constexpr absl::Duration kPatience = absl::Seconds(20);
// Takes ports below those that the system gives to clients, so that a server's port stays free
// while the server is down.
constexpr int kFirstPort = 20'000, kNumPorts = 12'000;

std::string Here(int port) { return absl::StrCat("127.0.0.1:", port); }

std::shared_ptr<grpc::Channel> Open(int port, const grpc::SslCredentialsOptions& tls,
                                    const std::string& token) {
  std::shared_ptr<grpc::ChannelCredentials> credentials = grpc::SslCredentials(tls);
  if (!token.empty()) {
    credentials =
        grpc::CompositeChannelCredentials(credentials, grpc::AccessTokenCredentials(token));
  }
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::CreateCustomChannel(Here(port), credentials, arguments);
}

}  // namespace

int FreePort() {
  static int next = kFirstPort + getpid() * 16 % kNumPorts;
  for (int tries = 0; tries < kNumPorts; ++tries) {
    const int port = kFirstPort + (++next - kFirstPort) % kNumPorts;
    const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const bool is_free =
        bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    close(socket);
    if (is_free) return port;
  }
  ADD_FAILURE() << "no port is free";
  return 0;
}

bool HasHaproxy() { return access(kHaproxy, X_OK) == 0 && access(kLuaossl, R_OK) == 0; }

Fleet::Fleet(const FleetOptions& options)
    : options_(options),
      data_(options.data.empty() ? folder / "data" : options.data),
      of_gateway_(clients.Issue("gateway")),
      servers_(static_cast<size_t>(options.num_servers)) {
  WriteFiles();
  for (int i = 0; i < options.num_servers; ++i) {
    ports_.push_back(FreePort());
    StartServer(i);
  }
  gateway_port_ = FreePort();
  metrics_port_ = FreePort();
  RestartGateway(options.num_servers);
}

void Fleet::WriteFiles() {
  const IssuedCertificate server = authority.Issue("server");
  std::ofstream(folder / "server.pem") << server.certificate << server.key;
  std::ofstream(folder / "server.key") << server.key;
  std::ofstream(folder / "gateway.pem") << of_gateway_.certificate << of_gateway_.key;
  std::ofstream(folder / "authority.pem") << authority.certificate();
  std::ofstream(folder / "clients.pem") << clients.certificate();
  std::ofstream(folder / "jwt.pem") << issuer.public_key();
  std::ofstream(folder / "next_jwt.pem") << next_issuer.public_key();
}

void Fleet::StartServer(int i) {
  const auto flag = [this](const char* name, const char* file) {
    return absl::StrCat(name, (folder / file).string());
  };
  PepesegdOptions server{{flag("--tls-certificate=", "server.pem"),
                          flag("--tls-key=", "server.key"), flag("--tls-client-ca=", "clients.pem"),
                          "--require-keys", "--trusted-gateway=gateway", "--drain-seconds=3"},
                         {},
                         options_.worker,
                         absl::StrCat("-", i),
                         false};
  if (!options_.database.empty()) server.arguments.push_back("--database=" + options_.database);
  server.arguments.insert(server.arguments.end(), options_.server_arguments.begin(),
                          options_.server_arguments.end());
  server.listen = Here(ports_[i]);
  server.credentials =
      grpc::SslCredentials({authority.certificate(), of_gateway_.key, of_gateway_.certificate});
  servers_[i] = std::make_unique<PepesegdProcess>(data_, server);
}

std::optional<WorkerEnd> Fleet::StopServer(int i) {
  std::optional<WorkerEnd> end = servers_[i]->Terminate();
  servers_[i].reset();
  return end;
}

void Fleet::RestartGateway(int num_servers) {
  gateway_.reset();
  // HAProxy does not append to its standard output.
  log_ = folder / absl::StrCat("gateway", ++num_starts_, ".log");
  const auto variable = [this](const char* name, const char* file) {
    return absl::StrCat(name, "=", (folder / file).string());
  };
  std::vector<std::string> environment = options_.gateway_environment;
  const std::vector<std::string> usual = {
      variable("PEPESEG_GATEWAY_CERTIFICATE", "server.pem"),
      variable("PEPESEG_GATEWAY_CLIENT_CERTIFICATE", "gateway.pem"),
      variable("PEPESEG_SERVERS_CA", "authority.pem"),
      variable("PEPESEG_JWT_KEY", "jwt.pem"),
      variable("PEPESEG_JWT_NEXT_KEY", "next_jwt.pem"),
      absl::StrCat("PEPESEG_JWT_ISSUER=", TokenIssuer::kIssuer),
      absl::StrCat("PEPESEG_JWT_AUDIENCE=", TokenIssuer::kAudience),
      absl::StrCat("PEPESEG_GATEWAY_LUA=", PEPESEG_GATEWAY_FOLDER, "/tls_errors.lua"),
      absl::StrCat("PEPESEG_GATEWAY_LISTEN=", Here(gateway_port_)),
      absl::StrCat("PEPESEG_GATEWAY_METRICS=", Here(metrics_port_)),
  };
  environment.insert(environment.end(), usual.begin(), usual.end());
  for (int i = 0; i < num_servers; ++i) {
    environment.push_back(absl::StrCat("PEPESEG_SERVER_", i + 1, "=", Here(ports_[i])));
  }
  auto process = WorkerProcess::Launch(
      {kHaproxy, {"-db", "-f", PEPESEG_GATEWAY_FOLDER "/haproxy.cfg"}, log_, environment});
  EXPECT_OK(process);
  if (process.ok()) gateway_ = std::move(process).value();
  EXPECT_TRUE(AwaitServing(num_servers)) << LogTail();
}

std::string Fleet::Metrics() const { return HttpGet(metrics_port_, "/metrics"); }

int Fleet::CountServing() const {
  const std::string metrics = Metrics();
  int count = 0;
  for (size_t i = 0; i < ports_.size(); ++i) {
    const std::string line = absl::StrCat("haproxy_server_status{proxy=\"servers\",server=\"server",
                                          i + 1, "\",state=\"UP\"} 1");
    count += metrics.find(line) != std::string::npos ? 1 : 0;
  }
  return count;
}

// HAProxy counts its servers as up until its first checks have failed.
bool Fleet::AwaitServing(int num_servers) const {
  const absl::Time deadline = absl::Now() + kPatience;
  int stable = 0;
  while (absl::Now() < deadline && stable < 3) {
    absl::SleepFor(absl::Milliseconds(100));
    stable = CountServing() == num_servers ? stable + 1 : 0;
  }
  return stable == 3;
}

std::shared_ptr<grpc::Channel> Fleet::Connect(const std::string& token) const {
  return Open(gateway_port_, {authority.certificate(), "", ""}, token);
}

std::shared_ptr<grpc::Channel> Fleet::ConnectDirectly(int i, const std::string& token) const {
  return ConnectDirectly(i, token, of_gateway_);
}

std::shared_ptr<grpc::Channel> Fleet::ConnectDirectly(int i, const std::string& token,
                                                      const IssuedCertificate& own) const {
  return Open(ports_[i], {authority.certificate(), own.key, own.certificate}, token);
}

std::string Fleet::Database() const {
  return options_.database.empty() ? absl::StrCat("sqlite:", DatabasePath(data_).string())
                                   : options_.database;
}

std::string Fleet::MakeKey(const std::string& project, const std::vector<v1::Scope>& scopes) const {
  auto key = pepeseg::MakeKey();
  EXPECT_OK(key);
  key->record.project = project;
  for (const v1::Scope scope : scopes) key->record.scopes |= ScopeBit(scope);
  const auto store = Store::Open(Database());
  EXPECT_OK(store);
  if (store.ok()) {
    EXPECT_OK((*store)->keys().CreateKey(key->record));
  }
  return key->secret;
}

std::vector<nlohmann::json> Fleet::ReadLog(size_t offset) const {
  std::vector<nlohmann::json> lines;
  std::ifstream file(log_);
  file.seekg(static_cast<std::streamoff>(offset));
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("{\"", 0) != 0) continue;
    auto parsed = nlohmann::json::parse(line, nullptr, /*allow_exceptions=*/false);
    if (parsed.is_object()) lines.push_back(std::move(parsed));
  }
  return lines;
}

size_t Fleet::LogSize() const { return std::filesystem::file_size(log_); }

std::string Fleet::ReadAudit() const {
  std::ifstream file(AuditPath(data_));
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace pepeseg::testing
