from .lab_key import (
    LabKey as LabKey,
    create_key as create_key,
    public_file as public_file,
    read_key as read_key,
)
from .run_seal import (
    SEAL as SEAL,
    SIGNATURE as SIGNATURE,
    FileList as FileList,
    RunSeal as RunSeal,
    list_files as list_files,
    read_seal as read_seal,
    write_seal as write_seal,
)
from .signature import (
    NAMESPACE as NAMESPACE,
    PublicKey as PublicKey,
    Signers as Signers,
    read_signers as read_signers,
    signature_text as signature_text,
    signer_of as signer_of,
)
