#include "server/access/access_options.h"

#include <gtest/gtest.h>

#include <fstream>

#include "server/access/credentials.h"
#include "tests/server/access/test_certificates.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

struct CertificateFiles : ::testing::Test {
  CertificateFiles() {
    options.tls_certificate = folder / "chain.pem";
    options.tls_key = folder / "key.pem";
    Write("chain.pem", issued.certificate + authority.certificate());
    Write("key.pem", issued.key);
  }
  void Write(const std::string& name, const std::string& text) {
    std::ofstream(folder / name, std::ios::trunc) << text;
  }
  void ExpectRefused(const std::string& file, const std::string& words) {
    const auto texts = ReadCertificateFiles(options);
    EXPECT_TRUE(absl::IsFailedPrecondition(texts.status())) << texts.status();
    EXPECT_NE(texts.status().message().find(file), std::string::npos) << texts.status();
    EXPECT_NE(texts.status().message().find(words), std::string::npos) << texts.status();
  }

  testing::TempFolder folder;
  testing::TestAuthority authority{"authority"};
  testing::IssuedCertificate issued = authority.Issue("server");
  AccessOptions options;
};

TEST_F(CertificateFiles, AreReadIfTheyBelongTogether) {
  auto texts = ReadCertificateFiles(options);
  ASSERT_OK(texts);
  EXPECT_EQ(texts->key, issued.key);
  EXPECT_EQ(texts->client_ca, "");
  Write("ca.pem", authority.certificate());
  options.tls_client_ca = folder / "ca.pem";
  texts = ReadCertificateFiles(options);
  ASSERT_OK(texts);
  EXPECT_EQ(texts->client_ca, authority.certificate());
}

TEST_F(CertificateFiles, AreRefusedByName) {
  Write("key.pem", authority.Issue("another").key);
  ExpectRefused("key.pem", "not the key of");
  Write("key.pem", issued.key.substr(0, issued.key.size() / 2));
  ExpectRefused("key.pem", "no private key");
  Write("key.pem", "");
  ExpectRefused("key.pem", "no private key");
  Write("key.pem", issued.key);
  Write("chain.pem", "no certificate at all");
  ExpectRefused("chain.pem", "no certificate");
  Write("chain.pem", std::string(2 << 20, 'x'));
  ExpectRefused("chain.pem", "1 MiB");
  Write("chain.pem", issued.certificate);
  options.tls_client_ca = folder / "ca.pem";
  ExpectRefused("ca.pem", "cannot be read");
  Write("ca.pem", "nobody");
  ExpectRefused("ca.pem", "no certificate");
  options.tls_client_ca.clear();
  std::filesystem::remove(folder / "key.pem");
  ExpectRefused("key.pem", "cannot be read");
}

TEST_F(CertificateFiles, AreRefusedIfIncomplete) {
  options.tls_key.clear();
  EXPECT_NE(CheckCertificateOptions(options).message().find("without --tls-key"),
            std::string::npos);
  options.tls_key = options.tls_certificate;
  options.tls_certificate.clear();
  EXPECT_NE(CheckCertificateOptions(options).message().find("without --tls-certificate"),
            std::string::npos);
  options.tls_key.clear();
  EXPECT_OK(CheckCertificateOptions(options));
  options.tls_client_ca = folder / "ca.pem";
  EXPECT_TRUE(absl::IsFailedPrecondition(CheckCertificateOptions(options)));
}

TEST_F(CertificateFiles, AllowATrustedGatewayOnlyWithAClientCaAndKeys) {
  options.trusted_gateway = "gateway";
  options.require_keys = true;
  EXPECT_NE(CheckCertificateOptions(options).message().find("without --tls-client-ca"),
            std::string::npos);
  options.tls_client_ca = folder / "ca.pem";
  EXPECT_OK(CheckCertificateOptions(options));
  options.require_keys = false;
  EXPECT_NE(CheckCertificateOptions(options).message().find("without --require-keys"),
            std::string::npos);
}

TEST(MemoryFile, IsReadByItsPathAndReplacedAtomically) {
  const auto read = [](const std::string& path) {
    std::ifstream file(path);
    return std::string((std::istreambuf_iterator<char>(file)), {});
  };
  MemoryFile file;
  ASSERT_OK(file.Replace("first"));
  const std::string path = file.path();
  EXPECT_EQ(read(path), "first");
  const auto time = std::filesystem::last_write_time(path);
  std::ifstream reader(path);
  ASSERT_OK(file.Replace("second text"));
  EXPECT_EQ(file.path(), path);
  EXPECT_EQ(read(path), "second text");
  EXPECT_EQ(std::string((std::istreambuf_iterator<char>(reader)), {}), "first");
  EXPECT_GE(std::filesystem::last_write_time(path) - time, std::chrono::seconds(1));
}

}  // namespace
}  // namespace pepeseg
