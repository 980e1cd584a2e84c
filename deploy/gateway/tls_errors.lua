-- HAProxy before 3.0.4 (and Debian's 2.6.12) leaves OpenSSL's errors about a wrong signature in the
-- thread's queue. The next connection that reads nothing takes them for its own and ends, so a forged
-- token could break other callers' calls (github.com/haproxy/haproxy/issues/2643). luaossl empties the
-- queue when one of its functions fails, so this makes one fail.
local key = require('openssl.pkey')

core.register_action('drop_tls_errors', {'http-req'}, function()
  pcall(key.new, 'no key')
end)
