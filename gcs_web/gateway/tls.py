"""A given certificate for the page: loaded, and tried as a browser would before anybody needs it."""

import ipaddress
import socket
import ssl
from pathlib import Path

from flight import InputError

_NOT_YET_VALID, _EXPIRED, _OTHER_NAME, _OTHER_ADDRESS = 9, 10, 62, 64
"""X509_V_ERR_CERT_NOT_YET_VALID, _CERT_HAS_EXPIRED, _HOSTNAME_MISMATCH and _IP_ADDRESS_MISMATCH of OpenSSL."""


def is_loopback(host: str) -> bool:
    """Whether a name or address leads to this machine only.

    Raises:
        InputError: it cannot be resolved.
    """
    try:
        return ipaddress.ip_address(socket.gethostbyname(host)).is_loopback
    except OSError as error:
        raise InputError(f"--host {host}: {error.strerror}; give a name or an IPv4 address of this machine") from error


def context(certificate: Path, key: Path, host: str) -> ssl.SSLContext:
    """What a server needs to prove that it is `host`.

    Args:
        certificate: PEM, with those between it and its root after it, if there are any.
        key: PEM, without a password.

    Raises:
        InputError: a file is missing or damaged, they do not belong together, or the certificate is not valid today or
            not for this host.
    """
    for option, path in (("--tls-cert", certificate), ("--tls-key", key)):
        if not path.is_file():
            raise InputError(f"{option}: there is no file {path}")
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        server.load_cert_chain(certificate, key, password=lambda: _refuse_password(key))
    except ssl.SSLError as error:
        if error.reason == "KEY_VALUES_MISMATCH":
            said = f"the key {key} does not belong to the certificate {certificate}; give the pair"
        else:
            said = f"{certificate} and {key} are not a certificate and a key in PEM format ({error.reason})"
        raise InputError(said) from error
    except OSError as error:
        raise InputError(f"{certificate} or {key} cannot be read: {error.strerror}") from error
    _try(server, certificate, host)
    return server


def _refuse_password(key: Path) -> str:
    raise InputError(f"the key {key} has a password; give one without (openssl pkey -in {key} -out NEW)")


def _try(server: ssl.SSLContext, certificate: Path, host: str) -> None:
    """Shake hands in memory with a client that trusts the certificate itself: are its dates and its names right?"""
    client = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    client.load_verify_locations(certificate)
    client.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
    downward, upward = ssl.MemoryBIO(), ssl.MemoryBIO()
    sides = [
        client.wrap_bio(downward, upward, server_hostname=host),
        server.wrap_bio(upward, downward, server_side=True),
    ]
    while sides:
        side = sides.pop(0)
        try:
            side.do_handshake()
        except ssl.SSLWantReadError:
            sides.append(side)
        except ssl.SSLCertVerificationError as error:
            other = f"give --host the name that it is for, or a certificate for {host}"
            way_out = {
                _NOT_YET_VALID: "look at this machine's clock",
                _EXPIRED: "renew it",
                _OTHER_NAME: other,
                _OTHER_ADDRESS: other,
            }.get(error.verify_code, "give another one")
            raise InputError(f"a browser would refuse {certificate}: {error.verify_message}; {way_out}") from error
