using System;

namespace Handcal.Link
{
    /// <summary>
    /// The PC's address and a one-time code, from the text of a QR code or as typed; protocol.md,
    /// "Pairing by QR code".
    /// </summary>
    public sealed class Invitation
    {
        const string Scheme = "HANDCAL://";
        const int CodeCharacters = 26, DefaultPort = 47800;
        public readonly string Host;
        public readonly int Port;
        public readonly string Code;

        Invitation(string host, int port, string code)
        {
            Host = host;
            Port = port;
            Code = code;
        }

        /// <summary>Reads an invitation; false if the text is none.</summary>
        public static bool TryRead(string text, out Invitation invitation)
        {
            invitation = null;
            string all = (text ?? "").Trim().Split('?')[0].ToUpperInvariant();
            if (!all.StartsWith(Scheme, StringComparison.Ordinal)) return false;
            int slash = all.IndexOf('/', Scheme.Length);
            if (slash < 0) return false;
            string address = all.Substring(Scheme.Length, slash - Scheme.Length);
            string code = all.Substring(slash + 1);
            bool isCode = code.Length == CodeCharacters;
            foreach (char one in code) isCode &= (one >= 'A' && one <= 'Z') || (one >= '2' && one <= '7');
            if (!isCode || !TrySplit(address, out string host, out int port)) return false;
            invitation = new Invitation(host, port, code);
            return true;
        }

        /// <summary>Splits HOST:PORT or [IPV6]:PORT.</summary>
        public static bool TrySplit(string address, out string host, out int port)
        {
            host = "";
            port = 0;
            int colon = address.LastIndexOf(':');
            if (colon < 1) return false;
            host = address.Substring(0, colon);
            bool isBracketed = host[0] == '[' && host[host.Length - 1] == ']';
            if (isBracketed) host = host.Substring(1, host.Length - 2);
            else if (host.IndexOf(':') >= 0) return false;
            return host.Length > 0
                && int.TryParse(address.Substring(colon + 1), System.Globalization.NumberStyles.None,
                    System.Globalization.CultureInfo.InvariantCulture, out port)
                && IsPort(port);
        }

        /// <summary>
        /// Splits what is typed to pair by digits, "192.168.1.20 12345678", also with a port;
        /// false if there is no address or nothing behind it.
        /// </summary>
        public static bool TrySplitTyped(string text, out string host, out int port, out string digits)
        {
            string[] parts = (text ?? "").Trim().Split(new[] { ' ' }, 2);
            string address = parts[0];
            if (address.IndexOf(':') < 0 || address.EndsWith("]", StringComparison.Ordinal)) address += ":" + DefaultPort;
            digits = parts.Length < 2 ? "" : parts[1];
            return TrySplit(address, out host, out port) && digits.Length > 0;
        }

        public static bool IsPort(int number)
        {
            return number > 0 && number < 65536;
        }
    }
}
