"""The gateway: one OPC UA server with a vision system for each cell."""

import asyncio
import gc
import gzip
import logging
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from asyncua import Server, ua
from asyncua.common.utils import ServiceError
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from asyncua.crypto.truststore import TrustStore
from asyncua.crypto.validator import CertificateValidator, CertificateValidatorOptions
from asyncua.server.internal_session import InternalSession
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID

from gateways.opcua.cell import Cell
from gateways.opcua.sessions import KeyChecks, KeyServer
from gateways.opcua.settings import GatewayError, GatewaySettings, ServerSettings
from gateways.opcua.vision_system import CELLS, MACHINE_VISION, VisionSystem

log = logging.getLogger(__name__)

APPLICATION = "urn:handeyed:gateway"
NODESET = Path(__file__).with_name("Opc.Ua.MachineVision.NodeSet2.xml.gz")
"""The types of OPC 40100-1, of the OPC Foundation, under its MIT licence (in the file)."""

MAX_MESSAGE_BYTES = 1 << 18
MAX_CHUNKS = 5
"""A message that goes on for longer is cut off; without these limits three connections without a login hold 300 MB
(asyncua issues 1962 and 1963)."""

MAX_SESSION_MS = 60_000
"""A client that was cut off can return to its subscriptions for so long, and counts as one of `connections`."""

SUBTYPES = {
    "RecipeIdExternalDataType": (3002, 5002),
    "RecipeIdInternalDataType": (3013, 5268),
    "ConfigurationIdDataType": (3008, 5090),
}
"""Structures without fields of their own, which asyncua takes for their base: the numbers of type and encoding."""


@asynccontextmanager
async def serve(settings: GatewaySettings, alone: bool = False) -> AsyncIterator[str]:
    """Serve the cells; yields the endpoint at which clients connect. `alone`: in its process. Raises GatewayError."""
    cells: dict[str, Cell] = {}
    core = KeyServer(KeyChecks(cells))
    core.bind_condition_methods = True
    core.allow_remote_admin = False
    core.max_session_timeout_ms = MAX_SESSION_MS
    server = Server(iserver=core)
    server.set_endpoint(settings.server.endpoint)
    server.set_server_name("handeyed gateway")
    server.product_uri, server.manufacturer_name = "urn:handeyed:opcua", "handeyed"
    server.limits.max_message_size, server.limits.max_chunk_count = MAX_MESSAGE_BYTES, MAX_CHUNKS
    InternalSession.max_connections = settings.server.connections  # where asyncua looks for it
    gc.disable()  # all that is built stays: to go over it again and again would take half of the time
    try:
        await server.init()
        await _secure(server, settings.server)
        await server.import_xml(xmlstring=gzip.decompress(NODESET.read_bytes()).decode())
        await server.load_data_type_definitions()
        types = await server.get_namespace_index(MACHINE_VISION)
        for name, (data_type, encoding) in SUBTYPES.items():
            kind = type(name, (ua.BinaryIdBaseDataType,), {"data_type": ua.NodeId(data_type, types)})
            ua.register_extension_object(name, ua.NodeId(encoding, types), kind, ua.NodeId(data_type, types))
        await server.register_namespace(CELLS)
        for cell in settings.cell:
            system = VisionSystem(server, cell)
            await system.build()
            cells[cell.name] = system.cell
    finally:
        gc.enable()
    if alone:  # the collector goes over what clients leave behind only: soon enough, and in no 0.3 s
        gc.collect()
        gc.freeze()
    try:
        await server.start()
    except OSError as error:
        raise GatewayError(settings.server.endpoint, str(error), "choose another [server] endpoint") from None
    try:
        async with asyncio.TaskGroup() as tasks:
            following = [tasks.create_task(one.follow()) for one in cells.values()]
            following.append(tasks.create_task(core.end_revoked()))
            try:
                yield server.endpoint.geturl()
            finally:
                for task in following:
                    task.cancel()
    finally:
        await server.stop()


class TrustedFolder:
    """asyncua's certificate validator: what lies in the folder when a session is made."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._unread: set[Path] = set()

    async def __call__(self, certificate: x509.Certificate, description: ua.ApplicationDescription) -> None:
        """Raises ServiceError."""
        store = TrustStore([], [])
        if trusted := await asyncio.to_thread(self._certificates):
            store._trust_store = x509.verification.Store(trusted)
        what = CertificateValidatorOptions
        validator = CertificateValidator(what.TIME_RANGE | what.URI | what.TRUSTED | what.PEER_CLIENT, store)
        try:
            await validator(certificate, description)
        except ServiceError as error:
            name = ua.status_codes.get_name_and_doc(error.code)[0]
            log.warning("refused: the certificate of %s: %s", certificate.subject.rfc4514_string(), name)
            raise

    def _certificates(self) -> list[x509.Certificate]:
        """The folder's, DER or PEM. One that is no certificate, or is removed meanwhile, refuses nobody else."""
        read = []
        for file in self._folder.glob("*.*"):
            try:
                if file.suffix.lower() in (".der", ".pem", ".cer", ".crt"):
                    content = file.read_bytes()
                    pem = b"-----BEGIN" in content
                    read.append((x509.load_pem_x509_certificate if pem else x509.load_der_x509_certificate)(content))
            except (OSError, ValueError) as error:
                if file not in self._unread:
                    log.warning("%s is not read as a certificate: %s", file, error)
                self._unread.add(file)
        return read


async def _secure(server: Server, settings: ServerSettings) -> None:
    """Encrypted and signed only, a user name and a key only, trusted certificates only. Raises GatewayError."""
    await server.set_application_uri(APPLICATION)
    try:
        for folder in (settings.certificate.parent, settings.private_key.parent, settings.trusted):
            folder.mkdir(parents=True, exist_ok=True)
        files = settings.private_key, settings.certificate
        use = [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
        name = {"organizationName": "handeyed", "commonName": "handeyed gateway"}
        await setup_self_signed_certificate(*files, APPLICATION, socket.gethostname(), use, name)
        settings.private_key.chmod(0o600)
        await server.load_certificate(settings.certificate)
        await server.load_private_key(settings.private_key)
    except (OSError, ValueError) as error:
        fix = "let its user write there; or remove both: they are made anew, and clients have to trust the new one"
        raise GatewayError(str(settings.certificate), str(error), fix) from None
    kinds = ua.SecurityPolicyType
    server.set_security_policy([kinds.Basic256Sha256_SignAndEncrypt, kinds.Aes256Sha256RsaPss_SignAndEncrypt])
    server.set_identity_tokens([ua.UserNameIdentityToken])
    server.set_certificate_validator(TrustedFolder(settings.trusted))
