using System.Collections.Generic;

namespace Handcal.Link
{
    /// <summary>The messages that the headset sends, as the payload of a datagram or a slot.</summary>
    static class Envelope
    {
        public static byte[] Hello(byte[] nonce, ulong timeNs, byte[] cookie, string name)
        {
            return Of(Body.Hello, new ProtoWriter()
                .Bytes(1, nonce).Fixed(2, timeNs).Bytes(3, cookie).Text(4, Link.Device.Short(name)));
        }

        public static byte[] Pair(byte[] nonce, byte[] value, string name, byte[] cookie, bool isByCode)
        {
            return Of(Body.Pair, new ProtoWriter()
                .Bytes(1, nonce).Bytes(2, value).Text(3, Link.Device.Short(name)).Bytes(4, cookie).Flag(5, isByCode));
        }

        public static byte[] Device(Device device, string shownWearer, string shownRig)
        {
            return Of(Body.Device, device.Write(shownWearer, shownRig));
        }

        public static ProtoWriter Pose(long timeNs, double[] TWH)
        {
            return new ProtoWriter().Fixed(1, (ulong)timeNs).Doubles(2, TWH);
        }

        public static byte[] Poses(IEnumerable<ProtoWriter> poses)
        {
            return Repeated(Body.Poses, poses);
        }

        public static byte[] Pong(
            ulong sentHostNs, long receivedNs, long sentNs, ulong highestSequence, ulong accepted)
        {
            return Of(Body.Pong, new ProtoWriter()
                .Fixed(1, sentHostNs).Fixed(2, (ulong)receivedNs).Fixed(3, (ulong)sentNs)
                .Number(4, highestSequence).Number(5, accepted));
        }

        public static byte[] Confirm(long timeNs, uint cursorId, byte[] digest)
        {
            return Of(Body.Confirm, new ProtoWriter()
                .Fixed(1, (ulong)timeNs).Number(2, cursorId).Bytes(3, digest));
        }

        public static byte[] Nudge(uint verifyId, NudgeSum moved, bool fits, long timeNs, byte[] digest)
        {
            return Of(Body.Nudge, new ProtoWriter()
                .Number(1, verifyId)
                .Double(2, moved.RightArcmin).Double(3, moved.DownArcmin).Double(4, moved.Size)
                .Flag(5, fits).Fixed(6, (ulong)timeNs).Bytes(7, digest));
        }

        /// <summary>An Ack; without receipts it only keeps the session alive.</summary>
        public static byte[] Ack(IEnumerable<ProtoWriter> receipts)
        {
            return Repeated(Body.Ack, receipts);
        }

        public static byte[] Bye()
        {
            return Of(Body.Bye, new ProtoWriter());
        }

        static byte[] Repeated(Body body, IEnumerable<ProtoWriter> parts)
        {
            var message = new ProtoWriter();
            foreach (ProtoWriter part in parts) message.Message(1, part);
            return Of(body, message);
        }

        static byte[] Of(Body body, ProtoWriter message)
        {
            return new ProtoWriter().Message((int)body, message).ToArray();
        }
    }
}
